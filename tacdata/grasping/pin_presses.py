"""Solves the presses that ship: `python -m tacdata.grasping.pin_presses --device cuda:0 --capacity 128`."""

from __future__ import annotations

import argparse

from tacdata.grasping.fingertip import fingertip_sensor
from tacdata.grasping.press_set import FOLDER, solved_presses
from tacdata.grasping.presses import TRAINING, orange_presses, training_presses
from tacdata.skin.model import ModelSettings, SkinModel


def main() -> None:
    """Solve and write both sets."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--capacity", type=int, default=1)
    options = parser.parse_args()
    sensor = fingertip_sensor()
    model = SkinModel(sensor, ModelSettings(error_estimate=False), options.device)
    for name, requests in (("orange", orange_presses()), ("training", training_presses(sensor, TRAINING))):
        solved = solved_presses(model, requests, options.capacity)
        solved.write(FOLDER / f"{name}.npz")
        print(f"{name}: {int((solved.counts > 0).sum())} of {len(requests)} presses")


if __name__ == "__main__":
    main()
