"""A session brought to a service that cannot see its folder: whole, once, and nowhere else than asked for."""

import hashlib
import urllib.parse

import pytest
from chaos import Service, all_finished
from running.in_process import tacdata
from session_examples import session

from tacdata.errors import FormatError, TacdataError, UsageError
from tacdata.label_farm.remote import send as sending
from tacdata.label_farm.service import receiving


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    with Service(tmp_path_factory.mktemp("served"), workers=1, seconds=0.0) as service:
        yield service


@pytest.fixture
def mine(tmp_path):
    return session(tmp_path / "mine", 3)


def verb(service, *arguments):
    return tacdata("farm", *arguments, "--url", service.url)


def names(folder):
    return sorted(path.name for path in folder.iterdir() if path.is_file())


def post(client, content, offset=0, digest="", size=0, **asked):
    given = {
        "folder": "piecewise",
        "name": "episode-000000.mcap",
        "size": size or len(content),
        "offset": offset,
        **asked,
    }
    given["sha256"] = digest or hashlib.sha256(content).hexdigest()
    return client.send("POST", f"/api/recordings?{urllib.parse.urlencode(given)}", content)


def test_sent_submitted_and_fetched_without_a_shared_disk(service, mine):
    shown = verb(service, "send", mine, "--to", "lab/monday")
    assert shown.returncode == 0 and "files sent: 4" in shown.stdout, shown.stderr
    there = service.folder / "lab" / "monday"
    assert names(there) == names(mine) and all((there / n).read_bytes() == (mine / n).read_bytes() for n in names(mine))
    filed = service.client().post("/api/submissions", {"session": "lab/monday", "by": "ann"})["id"]
    service.wait(all_finished)
    shown = verb(service, "fetch", filed, mine)
    assert shown.returncode == 0 and "labels fetched: 3" in shown.stdout, shown.stderr
    assert names(mine / "labels") == [f"episode-{k:06d}.parquet" for k in range(3)]
    again = verb(service, "send", mine, "--to", "lab/monday")
    assert "files sent: 0 (0.0 MB), already there: 4" in again.stdout, again.stderr


def test_what_was_broken_off_goes_on_within_the_file(service, mine, monkeypatch):
    client, pieces = service.client(), []
    monkeypatch.setattr(sending, "PIECE", 4096)
    true = client.send

    def cut(method, path, body=None, headers=None):
        if body:
            pieces.append(len(body))
            if len(pieces) == 3:
                raise ConnectionResetError(104, "cut")
        return true(method, path, body, headers)

    monkeypatch.setattr(client, "send", cut)
    with pytest.raises(TacdataError):
        sending.send(client, mine, "broken")
    assert not (service.folder / "broken" / "episode-000000.mcap").exists(), "no half of a file bears its name"
    client.post("/api/submissions", {"session": "broken", "by": "ann"})
    state = service.wait(lambda state: all_finished(state) and state)
    assert "no session.json" in state["submissions"][-1]["reason"], "a part of a session is none"
    sent = sending.send(client, mine, "broken")
    whole = sum((mine / name).stat().st_size for name in names(mine))
    assert sent.size == whole - 2 * 4096 and names(service.folder / "broken") == names(mine)


def test_a_file_that_lies_there_is_never_replaced(service, mine):
    client = service.client()
    sending.send(client, mine, "kept")
    path = service.folder / "kept" / "episode-000001.mcap"
    before = path.read_bytes()
    (mine / "episode-000001.mcap").write_bytes(before + b"\0")
    with pytest.raises(UsageError, match="another episode-000001") as error:
        sending.send(client, mine, "kept")
    assert "--to" in error.value.remedy and path.read_bytes() == before


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"folder": "../out"}, "a path inside the folder"),
        ({"folder": "/etc"}, "a path inside the folder"),
        ({"folder": "."}, "a folder of their own"),
        ({"folder": "farm/00"}, "a folder of their own"),
        ({"name": "../episode-000000.mcap"}, "finished recordings"),
        ({"name": "rig.yaml"}, "finished recordings"),
        ({"name": "episode-000000.mcap\n"}, "finished recordings"),
    ],
)
def test_recordings_go_into_a_folder_of_their_own(service, asked, words):
    before = sorted(service.folder.rglob("episode*"))
    with pytest.raises(UsageError, match=words):
        post(service.client(), b"x", **asked)
    assert sorted(service.folder.rglob("episode*")) == before


def test_what_does_not_arrive_as_announced_is_not_kept(service, monkeypatch):
    client = service.client()
    with pytest.raises(FormatError, match="another SHA-256"):
        post(client, b"some bytes", digest="0" * 64)
    with pytest.raises(UsageError, match="as announced"):
        post(client, b"some bytes", size=3)
    assert post(client, b"later", offset=7, size=50, digest="1" * 64) == b'{"have":0,"whole":false}'
    with pytest.raises(UsageError, match="no room for"):
        post(client, b"x", size=receiving.MOST)
    with pytest.raises(FormatError, match="size"):
        post(client, b"x", size=receiving.MOST + 1)
    assert not list((service.folder / "piecewise").glob("*"))
