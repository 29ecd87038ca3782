"""The commands of the page on looking run as they stand, on a folder that holds everything that it names."""

import json
import re
import shlex
import sys
import urllib.request
from dataclasses import replace

import numpy as np
import pytest
from example_folder import dent
from running.in_process import tacdata
from running.typed_pages import HOW_TO, commands

from tacdata.dataset import edit, pack
from tacdata.dataset.format import metadata
from tacdata.discrepancy.model.spec import read_spec
from tacdata.labels import write_label
from tacdata.recording import read_episode
from tacdata.training.inference.prediction import PredictedMaps, write_prediction
from tacdata.training.settings import TrainingSettings
from tacdata.training.train import train
from tacdata.viewers.browse import catalogue
from tacdata.viewers.rerun import window

TESTS = HOW_TO.parents[1] / "tests"
for room in ("dataset", "label_farm", "replay", "revision", "demonstrations", "training"):
    sys.path.append(str(TESTS / room))

PAGE = HOW_TO / "look.md"
EPISODES, FRAMES = 20, 6
"""Of the dataset: as many as the page splits."""


def predicted(label, sensor, number, factor):
    """Return a network's maps of a label's frames."""
    return PredictedMaps(
        episode=number,
        time_ns=label.time_ns,
        depth=np.float32(factor) * np.maximum(label.signed, 0),
        part="test",
        checkpoint="ab" * 32,
        network="tacprint",
        dataset="cd" * 32,
        sensor=sensor.content_hash,
        provenance=label.provenance,
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with everything that the page names."""
    root = tmp_path_factory.mktemp("looked_at")
    _network(root)
    _session(root)
    _dataset(root)
    _demonstrations(root)
    _verdict(root)
    return root


def _network(root):
    from training_frames import build_frames

    settings = TrainingSettings(arguments={"hidden": 16, "channels": 4}, epochs=1)
    train(build_frames(4), settings, root / "network", device="cpu", threads=1)


def _session(root):
    import session_examples

    folder = session_examples.session(root / "session", 5)
    (folder / "episode-000004.mcap").rename(folder / "episode-000004.partial.mcap")
    for number in range(4):
        episode = read_episode(folder / f"episode-{number:06d}.mcap")
        label = dent(episode)
        for place, factor in (("session/labels", 1.0), ("relabelled", 0.9)):
            own = replace(label, signed=np.float32(factor) * label.signed)
            write_label(root / place / f"episode-{number:06d}.parquet", own)
        if number >= 2:
            maps = predicted(label, episode.sensor, number, 0.8)
            write_prediction(root / "network" / "predictions" / f"episode-{number:06d}.parquet", maps)


def _dataset(root):
    import press_example

    made = [press_example.episode(n, FRAMES) for n in range(EPISODES + 4)]
    whole = [replace(e, press=replace(e.press, indenter_name="ball" if e.number % 2 else "pin")) for e in made]
    pack(whole[:EPISODES], press_example.label, root / "dataset")
    for name, part in (("monday", whole[-4:-2]), ("tuesday", whole[-2:])):
        pack(part, press_example.label, root / name)
    for episode in whole[5:8]:
        label = press_example.label(episode)
        for name, factor in (("network", 0.8), ("other", 0.9)):
            maps = predicted(label, episode.sensor, episode.number, factor)
            write_prediction(root / name / "predictions" / f"episode-{episode.number:06d}.parquet", maps)


def _demonstrations(root):
    from demo_examples import rig
    from tracked_hand import tracks

    from tacdata.demonstrations.recording.session import open_demo_session
    from tacdata.virtual_rig.world.hand import draw_hand

    open_demo_session(root / "demos", rig(), "grasp", resume=False)
    (root / "demos" / "episode-000000.mcap").write_bytes(b"stand-in")
    tracks(root / "demos", draw_hand(1), "grasp", "0" * 64)
    made = tacdata("export", "demos", "--out", "targets", "--format", "csv", folder=root)
    assert made.returncode == 0, made.stderr


def _verdict(root):
    import revised_bench

    session = revised_bench.record(root / "bench", late=0.08)
    revised_bench.verdict(root / "verdict", "latency", {"L": 0.07}, session=session)
    made = tacdata("revise", "verdict", session, "--out", "revision", folder=root)
    assert made.returncode == 0, made.stderr + made.stdout


@pytest.fixture
def looked_at(monkeypatch):
    """Ask for the page, the list and an episode in place of the person who looks at what is served."""
    found = {}

    def look():
        said = sys.stdout.getvalue()
        if "catalogue " in said:
            found["catalogue"] = datasets(re.search(r"catalogue rerun\+(\S+)\n", said)[1])
            return
        address = re.search(r"open (\S+)/\n", said)[1]
        for path in ("/", "/list", "/episode/7.rrd"):
            if path.startswith("/episode") and "entries" in json.loads(found["/list"]):
                found["studio"] = json.loads(found["/list"])["entries"]
                return
            with urllib.request.urlopen(address + path, timeout=60) as answer:
                found[path] = answer.read()

    monkeypatch.setattr(catalogue, "PORT", window.any_port())  # the catalogue's own tests may run at the same time
    monkeypatch.setattr(window, "has_display", lambda: False)
    monkeypatch.setattr(window, "until_interrupted", look)
    return found


def datasets(address):
    """Ask a catalogue for its entries, by gRPC over HTTP; names stand in the answer as plain text."""
    request = urllib.request.Request(
        f"{address}/rerun.cloud.v1alpha1.RerunCloudService/FindEntries",
        data=b"\0\0\0\0\0",
        method="POST",
        headers={"Content-Type": "application/grpc-web+proto", "X-Grpc-Web": "1"},
    )
    with urllib.request.urlopen(request, timeout=60) as answer:
        return answer.read().decode("latin-1")


def edited(root):
    """Leave a dataset as lerobot's own edit tools do: without our sensor and records."""
    edit.delete(root / "dataset", [0], root / "edited")
    for name in (metadata.MAIN, metadata.RECORDS):
        (root / "edited" / name).unlink()


@pytest.mark.long("tacdata/commands", "docs/how_to/look.md", reason="a page typed from beginning to end")
def test_every_command_of_the_page_runs(folder, looked_at):
    said, shown = {}, folder / "shown.rrd"
    edited(folder)
    (folder / "before.json").write_text(json.dumps(read_spec(None).document))
    (folder / "after.json").write_bytes((folder / "revision" / "spec.json").read_bytes())
    for words in commands(PAGE):
        opens = words[0] in ("view", "compare") and "--foxglove" not in words
        shown.unlink(missing_ok=True)
        done = tacdata(*words, *(["--save", shown] if opens else []), folder=folder)
        assert done.returncode == 0, f"tacdata {shlex.join(words)}: {done.stdout}{done.stderr}"
        assert not opens or shown.stat().st_size > 5_000, shlex.join(words)
        said[shlex.join(words)] = done.stdout
    assert {"Sessions", "Datasets", "Networks", "Verdicts"} <= {entry["section"] for entry in looked_at["studio"]}
    assert "session" in looked_at["catalogue"], "what Rerun's server holds, by its own answer"
    assert len(said) == 26 and looked_at["/episode/7.rrd"][:4] == b"RRF2" and b"<title>" in looked_at["/"]
