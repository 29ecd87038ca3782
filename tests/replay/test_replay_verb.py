"""The verb: a tracked demonstration in, rates with intervals and a Rerun file out."""

import json
import sys

import numpy as np
import pytest
from test_scene import HAND, RATE

from tacdata import documents
from tacdata.cli import main
from tacdata.demonstrations.demonstration import Demonstration, FingerTrack
from tacdata.demonstrations.tracks_file import write_tracks
from tacdata.sensor import default_sensor
from tacdata.virtual_rig.hand import DIRECTIONS
from training.wilson import interval


@pytest.fixture
def tracked(tmp_path):
    """Tracks as a perfect tracker and network would give them."""
    from scipy.spatial.transform import Rotation

    times = np.arange(int(8.4 * RATE)) / RATE
    tracks, count = {}, len(times)
    for name in DIRECTIONS:
        poses = np.array([HAND.tip(name, t) for t in times])
        depth = np.array([HAND.press(name, t)[2] for t in times], np.float32)
        tracks[name] = FingerTrack(
            name, "right", name, poses[:, :3, 3], Rotation.from_matrix(poses[:, :3, :3]).as_quat(),
            np.tile(1e-8 * np.eye(6), (count, 1, 1)), np.zeros(count, bool), count, 0,
            np.zeros((count, 24), np.float32),
            np.repeat(depth, 35 * 26).reshape(count, 35, 26),
        )  # fmt: skip
    network = {"hash": "f" * 64, "network": "none", "epoch": 0, "lookahead": 0, "sensor": "0"}
    made = Demonstration(
        "episode-000000.mcap", "e" * 64, "grasp", "table", RATE, np.rint(times * 1e9).astype(np.int64), tracks,
        dict.fromkeys(tracks, default_sensor()), {}, network, (), {"made_by": "a test"},
    )  # fmt: skip
    path = tmp_path / "episode-000000.tracks.parquet"
    write_tracks(path, made)
    return path


def run(arguments):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["tacdata", *map(str, arguments)])
        try:
            main()
        except SystemExit as end:
            return end.code or 0
    return 0


def test_rates_come_with_wilson_intervals(tracked, tmp_path, capsys):
    out, view = tmp_path / "result.json", tmp_path / "replay.rrd"
    assert run(["replay", tracked, "--seeds", "4", "--out", out, "--view", view]) == 0
    said = capsys.readouterr().out
    assert "undisturbed, direct: lost" in said and "undisturbed, compensated: held" in said
    found = json.loads(out.read_text())
    documents.check(found, "replay_result", "result")
    assert found["direct"]["held"] == 0 and found["compensated"]["held"] >= 3
    for kind in ("direct", "compensated"):
        assert found[kind]["of"] == 4 == sum(trial["kind"] == kind for trial in found["trials"])
        assert found[kind]["wilson_95"] == pytest.approx(interval(found[kind]["held"], 4))
    assert view.stat().st_size > 10_000
    assert run(["replay", tracked, "--out", out]) == 2
    assert "exists" in capsys.readouterr().err


def test_bad_arguments_end_in_words(tracked, tmp_path, capsys):
    for arguments, words in (
        ([tracked, "--task", "pour"], "no gains for task"),
        ([tracked, "--radius", "0"], "a ball of 0 mm"),
        ([tmp_path / "none.mcap"], "no file"),
        ([tracked, "--find-gain", "50"], "deepest reached"),
    ):
        assert run(["replay", *arguments]) == 2
        assert words in capsys.readouterr().err
