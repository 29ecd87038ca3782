"""Intervals on unseen shapes: each shape's errors come from a network that did not learn it."""

from dataclasses import replace

import numpy as np
import pytest
from training_frames import build_frames

from tacdata.errors import UsageError
from tacdata.training.inference import checkpoint
from tacdata.training.metrics import conformal_intervals
from tacdata.training.metrics.conformal_intervals import reliability
from tacdata.training.pretraining.recipe import recipe
from tacdata.training.pretraining.unseen_shapes import calibrate_on_unseen_shapes
from tacdata.training.train import train


@pytest.fixture(scope="module")
def odd():
    """Presses of three shapes, of which each reads otherwise: a network without one errs on it."""
    frames, taxels = build_frames(24, seed=2), build_frames(24, seed=2).taxels.copy()
    for span in frames.episodes:
        taxels[span.start : span.stop] *= {"sphere": 1.0, "cylinder": 0.7, "cone": 1.3}[span.shape]
    return replace(frames, taxels=taxels)


def test_intervals_hold_what_networks_without_the_shape_err(odd, tmp_path):
    settings = recipe({"network": "direct", "epochs": 6, "batch_size": 32, "split": "indenter", "seed": 1})
    run = train(odd, settings, tmp_path / "run", "cpu", threads=1)
    before = conformal_intervals.read(run.path.parent, run.content_hash)
    after = calibrate_on_unseen_shapes(run, odd, 2, "cpu", 1)
    kept = conformal_intervals.read(run.path.parent, run.content_hash)
    assert kept.source == "presses of shapes left out of training" and kept.factors == after.factors
    for number in range(2):
        division = checkpoint.load(tmp_path / "run" / f"without-{number}").split
        shapes = {part: {s.shape for s in odd.spans(getattr(division, part))} for part in ("train", "test")}
        assert not shapes["train"] & shapes["test"]
        assert not set(division.test) & set(run.split.test), "what is scored calibrates nothing"
    from tacdata.training.frames.windows import Windows
    from tacdata.training.inference.predictor import deviations, predict

    spans = odd.spans(run.split.test)
    windows = Windows(odd, run.network.offsets)
    chosen = [np.arange(s.start, s.stop) for s in spans]
    maps = [predict(run.network, windows, rows, 3.0) for rows in chosen]
    spreads = [deviations(run.network, windows, rows) for rows in chosen]
    labels = [odd.depth[s.start : s.stop] for s in spans]
    share = [
        {e["level"]: e["inside"] for e in reliability(k, maps, labels, 0.4, spreads)}[0.9] for k in (before, after)
    ]
    assert share[1] > share[0] + 0.05


def test_more_groups_than_shapes_are_refused(odd, tmp_path):
    settings = recipe({"network": "direct", "epochs": 1})
    run = train(odd, settings, tmp_path / "run", "cpu", threads=1)
    with pytest.raises(UsageError, match="9 groups of the 3 shapes"):
        calibrate_on_unseen_shapes(run, odd, 9, "cpu", 1)
