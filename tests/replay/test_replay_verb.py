"""The verb: a tracked demonstration in, rates with intervals and a Rerun file out."""

import json
import sys
from dataclasses import replace

import pytest
from PIL import Image
from test_scene import HAND
from tracked_hand import tracks

from tacdata import documents
from tacdata.cli import main
from tacdata.commands.replay import _other_network
from tacdata.demonstrations.paths.tracks_file import read_tracks
from tacdata.viewers.pictures import replay_film
from tacdata.virtual_rig.world.hand import draw_hand

WILSON = [(0.0, 0.4899), (0.0456, 0.6994), (0.1500, 0.8500), (0.3006, 0.9544), (0.5101, 1.0)]
"""Wilson's 95 % interval [1] of k successes in 4 trials, from its quadratic with z^2 = 3.841459."""


@pytest.fixture
def tracked(tmp_path):
    """The tracks of a hand that grasps."""
    return tracks(tmp_path, HAND, "grasp", "e" * 64)


def run(arguments):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["tacdata", *map(str, arguments)])
        try:
            main()
        except SystemExit as end:
            return end.code or 0
    return 0


def test_rates_come_with_wilson_intervals(tracked, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(replay_film.MOST, ".gif", 5)
    out, view, film = tmp_path / "result.json", tmp_path / "replay.rrd", tmp_path / "replay.gif"
    assert run(["replay", tracked, "--seeds", "4", "--out", out, "--view", view, "--video", film]) == 0
    said = capsys.readouterr().out
    assert "undisturbed, direct: lost" in said and "undisturbed, compensated: held" in said
    found = json.loads(out.read_text())
    documents.check(found, "replay_result", "result")
    assert found["direct"]["held"] == 0 and found["compensated"]["held"] >= 3
    for kind in ("direct", "compensated"):
        assert found[kind]["of"] == 4 == sum(trial["kind"] == kind for trial in found["trials"])
        assert found[kind]["wilson_95"] == pytest.approx(WILSON[found[kind]["held"]], abs=1e-4)
    assert found["scene"]["spreads"]["mass"]["half_width"] == 0.2 and found["scene"]["sizes"] == [0.035]
    assert all(trial["reason"].startswith("held" if trial["held"] else "lost") for trial in found["trials"])
    assert view.stat().st_size > 10_000
    with Image.open(film) as shown:
        assert getattr(shown, "n_frames", 1) == 5 and shown.size[0] > 500
    assert run(["replay", tracked, "--video", tmp_path / "replay.avi"]) == 2
    assert run(["replay", tracked, "--out", out]) == 2
    assert "exists" in capsys.readouterr().err


def test_bad_arguments_end_in_words(tracked, tmp_path, capsys):
    for arguments, words in (
        ([tracked, "--task", "pour"], "no gains for task"),
        ([tracked, "--radius", "0"], "--radius 0"),
        ([tracked, "--object", "pear"], "ball, can, box, eraser"),
        ([tmp_path / "none.mcap"], "no file"),
        ([tracked, "--find-gain", "--mass", "9"], "no gain up to"),
    ):
        assert run(["replay", *arguments]) == 2
        assert words in capsys.readouterr().err


def test_a_gain_that_was_found_with_another_network_is_said(tracked):
    made = read_tracks(tracked)
    other = replace(made, network={**made.network, "hash": "e" * 64})
    (words,) = _other_network(other, made)
    assert "predicted by checkpoint ffffffffffff, the gain is found with eeeeeeeeeeee" in words
    assert _other_network(made, made) == ()


def wiping(tmp_path, seed):
    """The tracks of a hand that wipes."""
    folder = tmp_path / f"wipe{seed}"
    folder.mkdir()
    return tracks(folder, draw_hand(seed, "wipe"), "wipe", f"{seed:x}" * 64)


@pytest.mark.long("tacdata/commands/replay.py", "tacdata/virtual_rig", reason="a gain is looked for, then two strokes")
def test_an_eraser_is_lost_without_compensation_and_a_gain_chosen_elsewhere_holds_it(tmp_path, capsys):
    training, first, second = (wiping(tmp_path, seed) for seed in (1, 2, 3))
    out, view = tmp_path / "wipe.json", tmp_path / "wipe.rrd"
    chosen = ["--find-gain", "--preliminary", "4", "--gain-from", training]
    assert run(["replay", first, second, "--seeds", "2", "--out", out, "--view", view, *chosen]) == 0
    found = json.loads(out.read_text())
    documents.check(found, "replay_result", "result")
    assert found["task"] == "wipe" and found["gains"] == {"thumb": 0.004, "index": 0.01, "middle": 0.01}
    assert found["direct"] == {"held": 0, "of": 4, "wilson_95": pytest.approx(WILSON[0], abs=1e-4)}
    assert found["compensated"]["held"] >= 3 and found["chosen"]["of"] == 4
    assert [one["rates"]["direct"]["of"] for one in found["recordings"]] == [2, 2]
    assert found["gain_chosen"]["hash"] == "1" * 64 and 0 < found["gain_chosen"]["gains"]["thumb"] < 0.03
    assert found["gain_chosen"]["demand"] == {"trials": 4, "slip": 0.003, "force": 6.0, "grip": 2.0}
    assert found["gain_chosen"]["slip"] <= 0.003 and found["gain_chosen"]["grip"] >= 2.0
    behind = [trial["behind"] for trial in found["trials"] if trial["kind"] == "direct"]
    assert min(behind) > 0.015  # the strokes leave it behind
    assert view.stat().st_size > 10_000
    capsys.readouterr()
    for arguments, words in (
        ([training, *chosen], "other recordings"),
        ([first, "--gain-from", training], "--find-gain"),
        ([first, "--task", "grasp"], "rise by"),
    ):
        assert run(["replay", *arguments]) == 2
        assert words in capsys.readouterr().err
