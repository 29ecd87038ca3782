"""The commands of the pages on hands and robots run as they stand: all in the long part."""

import re
import shlex
import subprocess
import sys
import time
from pathlib import Path

import pytest
from running.in_process import tacdata
from running.typed_pages import HOW_TO, blocks
from running.typed_pages import commands as shown
from tracked_hand import tracks

from tacdata.demonstrations.recording.session import open_demo_session
from tacdata.viewers.pictures import replay_film
from tacdata.virtual_rig.world.hand import draw_hand

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests" / "demonstrations"))
PAGES = [HOW_TO / name for name in ("hands.md", "own_robot.md")]
NAMES = {"DEMOS": "demos", "RUN": "network"}
"""What a page writes for a path of the reader's -> ours."""
FILES, RIG = ("export", "replay", "view"), ("virtual-rig", "record", "track", "live")
ELSEWHERE = {"calibrate-world": "demonstrations/test_hand_eye.py"}
"""Verb -> the test that types it."""
FASTER = {"replay": ["--seeds", "2", "--preliminary", "2"], "view": ["--save", "shown.rrd"], "live": ["--seconds", "3"]}
FASTER["grasp-study"] = ["--repeats", "1", "--epochs", "1"]
"""Verb -> what is added: less to wait for, and files instead of windows."""


def commands(page):
    """Return a page's commands as words, with our paths."""
    return [[NAMES.get(word, word).replace("DEMOS/", "demos/") for word in words] for words in shown(page)]


ALL = [words for page in PAGES for words in commands(page)]


def needs_rig(words):
    """Say whether a command needs devices or real recordings."""
    return words[0] in RIG or "open_x_tactile" in words


def typed(words, folder):
    """Type a command of a page; return what it said."""
    (folder / "shown.rrd").unlink(missing_ok=True)
    words = ["live.rrd" if word == "window" else word for word in words]
    more = [] if "--video" in words and words[0] == "view" else FASTER.get(words[0], [])
    done = tacdata(*words, *more, folder=folder)
    assert done.returncode == 0, f"tacdata {shlex.join(words)}: {done.stdout}{done.stderr}"
    return done.stdout


def test_every_command_is_typed_somewhere():
    assert {words[0] for words in ALL} == {*FILES, *RIG, *ELSEWHERE, "grasp-study"}
    for verb, place in ELSEWHERE.items():
        assert verb in (ROOT / "tests" / place).read_text(), f"{place} does not type {verb}"


def test_the_pages_files_are_what_the_commands_take():
    import yaml

    from tacdata import documents
    from tacdata.plans import Plan
    from tacdata.plans.recipe import write_out
    from tacdata.sensor import default_sensor

    pairs, block, item = blocks(PAGES[0], "yaml")
    documents.check(yaml.safe_load(pairs), "hand_eye_pairs", "hands.md")
    documents.check(yaml.safe_load(item), "replay_object", "hands.md")
    plan = Plan.from_document(write_out(yaml.safe_load(block), default_sensor(), "hands.md"), "hands.md")
    assert len(plan.presses) == 28 and {press.indenter_name for press in plan.presses} >= {"ball_35", "plate", "punch"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Two demonstrations that were tracked, and the robot of the page."""
    from demo_examples import rig

    open_demo_session(tmp_path / "demos", rig(), "grasp", resume=False)
    for number in range(2):
        (tmp_path / "demos" / f"episode-{number:06d}.mcap").write_bytes(b"stand-in")
        tracks(tmp_path / "demos", draw_hand(number + 1), "grasp", f"{number}" * 64, number)
    (tmp_path / "examples").symlink_to(PAGES[0].parents[2] / "examples")
    monkeypatch.chdir(tmp_path)
    (block,) = blocks(PAGES[1], "python")
    exec(compile(block, "own_robot.md", "exec"), {})
    return tmp_path


@pytest.mark.long(
    "tacdata/commands", "docs/how_to/hands.md", "docs/how_to/own_robot.md", reason="pages typed from beginning to end"
)
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_needs_tracks_alone_runs(page, folder, monkeypatch):
    monkeypatch.setitem(replay_film.MOST, ".mp4", 4)
    for words in commands(page):
        if words[0] in FILES and not needs_rig(words):
            said = typed(words, folder)
            if words[0] == "replay":
                kinds = dict(re.findall(r"^(\w+) +held (\d+) of", said, re.MULTILINE))
                assert kinds["direct"] == "0" and int(kinds.get("chosen", 4)) >= 2, said
    assert (folder / "joints").is_dir() and (folder / "targets").is_dir()


@pytest.mark.long("tacdata/commands", "docs/how_to/hands.md", reason="a hand, in its own time")
@pytest.mark.timeout(900)
def test_what_needs_a_rig_runs(tmp_path):
    wanted = [words for words in commands(PAGES[0]) if needs_rig(words)]
    assert wanted[0][0] == "virtual-rig"
    rig = subprocess.Popen([sys.executable, "-m", "tacdata.cli", *wanted[0]], cwd=tmp_path)
    try:
        end = time.monotonic() + 120
        while not (tmp_path / "rig" / "demo_rig.yaml").is_file() and time.monotonic() < end:
            time.sleep(0.2)
        said = {shlex.join(words): typed(words, tmp_path) for words in wanted[1:]}
    finally:
        rig.terminate()
        rig.wait(60)
    assert len(list((tmp_path / "demos").glob("episode-*.mcap"))) == 2
    assert any("predicted depth up to" in words for words in said.values())


@pytest.mark.long("tacdata/commands", "docs/how_to/hands.md", reason="a network is trained, and oranges lifted")
@pytest.mark.timeout(1800)
def test_the_study_of_grasps_runs(tmp_path):
    (study,) = (words for words in commands(PAGES[0]) if words[0] == "grasp-study")
    typed(study, tmp_path)
    assert (tmp_path / "study").is_dir()
