"""Finished labels brought to another computer: here a copy of the session outside of the service's root."""

import shutil

import pytest
from chaos import Service, all_finished, record
from running.in_process import tacdata

from tacdata.errors import UsageError
from tacdata.label_farm.labels.session_labels import SessionLabels
from tacdata.label_farm.remote.fetch import Fetch
from tacdata.labels import read_label

COUNT = 5


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A service that was asked for a session of five presses, of which the third finds no equilibrium."""
    folder = tmp_path_factory.mktemp("served")
    record(folder, 1, COUNT)
    with Service(folder, workers=1, seconds=0.2, FAST_MODEL_FAILS="-5.9") as service:
        service.client().post("/api/submissions", {"session": "session-0", "by": "ann"})
        yield service


@pytest.fixture
def copy(served, tmp_path):
    """The same recordings on another computer."""
    shutil.copytree(served.folder / "session-0", tmp_path / "mine", ignore=shutil.ignore_patterns("labels"))
    return tmp_path / "mine"


def fetch(service, *arguments):
    return tacdata("farm", "fetch", "000001", *arguments, TACDATA_FARM_URL=service.url)


def stamps(session):
    return {path: path.stat().st_mtime_ns for path in (session / "labels").glob("*.parquet")}


def same(here, there):
    names = sorted(path.name for path in (there / "labels").glob("episode-*.parquet"))
    return names == sorted(p.name for p in (here / "labels").glob("episode-*.parquet")) and all(
        (here / "labels" / name).read_bytes() == (there / "labels" / name).read_bytes() for name in names
    )


def test_labels_come_while_others_are_computed_and_only_once(served, copy):
    shown = fetch(served, copy, "--wait")
    assert shown.returncode == 5 and "labels fetched: 4, already here: 0, failed: 1" in shown.stdout, shown.stderr
    assert "episode 2: no label: no equilibrium" in shown.stdout
    assert same(copy, served.folder / "session-0")
    assert "no equilibrium" in SessionLabels(copy / "labels").failures(9)["2"]
    assert not list((copy / "labels").glob(".*"))
    before = stamps(copy)
    again = fetch(served, copy)
    assert "labels fetched: 0, already here: 4, failed: 1" in again.stdout
    assert before == stamps(copy)


def test_a_label_that_rotted_here_is_brought_again(served, copy):
    served.wait(all_finished)
    Fetch(served.client(), "000001", copy).bring()
    rotten = copy / "labels" / "episode-000003.parquet"
    rotten.write_bytes(rotten.read_bytes()[:-100])
    second = Fetch(served.client(), "000001", copy)
    second.bring()
    assert second.fetched.written == [3] and len(second.fetched.current) == 3
    assert same(copy, served.folder / "session-0")


def test_a_label_of_another_recording_is_refused(served, copy):
    served.wait(all_finished)
    recording = copy / "episode-000001.mcap"
    recording.write_bytes(recording.read_bytes() + b"\0")
    shown = fetch(served, copy)
    assert shown.returncode == 2 and "of another recording" in shown.stderr and "Traceback" not in shown.stderr
    assert not (copy / "labels" / "episode-000001.parquet").exists()


def test_a_label_made_from_something_else_is_replaced_only_if_asked(served, copy, solves, monkeypatch):
    from functools import partial

    from farm_examples import label_episodes

    from tacdata.recording.files.reader import read_episode

    served.wait(all_finished)
    monkeypatch.setenv("FAST_MODEL_VERSION", "2")
    label_episodes(copy / "labels", [read_episode(copy / f"episode-{k:06d}.mcap") for k in range(2)])
    mine = (copy / "labels" / "episode-000000.parquet").read_bytes()
    bring = partial(Fetch, served.client(), "000001", copy)
    with pytest.raises(UsageError, match="made from something else") as refusal:
        bring().bring()
    assert "--redo" in refusal.value.remedy and (copy / "labels" / "episode-000000.parquet").read_bytes() == mine
    asked = bring(redo=True)
    asked.bring()
    assert asked.fetched.written == [0, 1, 3, 4]
    assert read_label(copy / "labels" / "episode-000000.parquet").provenance["parents"]["model"]


def test_what_cannot_be_fetched_is_said(served, copy, tmp_path):
    served.wait(all_finished)
    client = served.client()
    with pytest.raises(UsageError, match="no submission"):
        Fetch(client, "999999", copy).bring()
    with pytest.raises(UsageError, match="no session"):
        Fetch(client, "000001", tmp_path)
    (copy / "episode-000001.mcap").unlink()
    shown = fetch(served, copy)
    assert shown.returncode == 2 and "episode 1, of which there is no recording here" in shown.stderr
    (served.folder / "empty").mkdir(exist_ok=True)
    refused = client.post("/api/submissions", {"session": "empty", "by": "ann"})["id"]
    served.wait(all_finished)
    with pytest.raises(UsageError, match=r"is refused: .*no session"):
        client.get(f"/api/submissions/{refused}/results")
