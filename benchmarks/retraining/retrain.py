"""Trains the network that ships again, from random weights, on a GPU.

    tacdata simulate benchmarks/retraining/pretraining.yaml --presses 7339 --solved WORK/solved --device cuda
    python benchmarks/retraining/retrain.py WORK/solved --out OUT

Solved presses become frames in memory first, by all cores. Without a GPU, `tacdata simulate` and `tacdata train` do the
same with fewer presses.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import replace
from pathlib import Path

HERE = Path(__file__).resolve().parent
PLAN = HERE / "pretraining.yaml"
STEPS = 44_000
"""Steps of 2,048 frames from random weights [count]. With 150,000 the validation loss was a tenth higher."""
VARIED = {"gain_jitter": 0.05, "scale_jitter": 0.15, "exponent_jitter": 0.1, "spread_jitter": 0.3}
"""Deviation of a calibrated unit from the model: gains, their mean, exponent, spreading of loads [1, 1, 1, mm^2].
With a wider one, shapes of similar readings get the mean of their maps (`trials.md`)."""
RECIPE = {
    "network": "pattern",
    "arguments": {"hidden": 512, "layers": 4},
    "learning_rate": 1.5e-3,
    "pull": 0.0,
    "idle_share": 0.3,
}
_HELD, _VALIDATED = 8, 120
"""Presses that are held out, and that give the validation loss [count]. Simulated presses need no more for a test."""


def main() -> None:
    """Pack, train, and write OUT/middle.safetensors in half precision."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("solved", type=Path, help="folder of `tacdata simulate --solved`")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seconds", type=float, default=3600.0, help="training ends by then; the rate falls sooner")
    parser.add_argument("--batch-size", type=int, default=2048, help="frames of a step")
    given = parser.parse_args()
    sys.path.insert(0, str(HERE))
    import graphed
    import presses

    from tacdata.training.pretraining.recipe import recipe
    from tacdata.training.splits.split import divide

    until = time.time() + given.seconds
    presses.pack(given.solved, given.out / "packed", len(os.sched_getaffinity(0)))
    frames = presses.thinned(presses.read(given.solved, given.out / "packed"))
    split = divide(frames, "episode", 0)
    learned = {*split.train, *split.test[_HELD:], *split.validation[_VALIDATED:]}
    split = replace(
        split, train=tuple(sorted(learned)), test=split.test[:_HELD], validation=split.validation[:_VALIDATED]
    )
    settings = recipe({**RECIPE, **VARIED, "batch_size": given.batch_size, "epochs": 1}, None)
    best = graphed.train_graphed(frames, settings, split, given.out / "run", STEPS, until)
    graphed.halved(best, given.out / "middle.safetensors")


if __name__ == "__main__":
    main()
