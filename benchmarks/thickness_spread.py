"""Loads over the skin's thickness, by finite elements, compared with the equation of `tacdata.effects.thickness`.

    python benchmarks/thickness_spread.py [--more 0.05] [--x 1.6] [--y 0.7] [--radius 4]

Solves a press of a sphere into the skin as it is, to its sides (for the gradient of the loads) and into one that is
thicker (meshed again), and fits the change by a common gain a and by how each load falls off, a q + k (2 q + r grad q).
Prints both, and how much of the residual of a gain alone the fit explains. Some eight minutes on one core.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

import tacdata.sensor
from tacdata.indenters.sphere import Sphere
from tacdata.sensor import read_sensor
from tacdata.skin.model import SkinModel
from tacdata.skin.press import PressRequest

DEPTHS = (0.0, 0.3, 0.6, 1.0)  # mm
ASIDE = 0.15  # mm


def loads(model, radius, x, y):
    """Return the loads on the protrusions [N] at each depth, shape (depths, taxels)."""
    press = PressRequest(Sphere(radius=radius), x, y, 0.0, DEPTHS)
    return np.array([state.taxel_force for depth, state in model.states(press) if depth > 0])


def main(more, x, y, radius):
    """Solve, fit, print."""
    sensor = read_sensor(Path(tacdata.sensor.__file__).with_name("tacprint.yaml"))
    skin, centers = SkinModel(sensor), np.asarray(sensor.taxels.centers)
    whole = loads(skin, radius, x, y)
    aside = [[loads(skin, radius, *(np.array([x, y]) + sign * ASIDE * axis)) for sign in (1, -1)] for axis in np.eye(2)]
    along = sum(
        (plus - minus) / (2 * ASIDE) * (at - centers[:, k])
        for k, ((plus, minus), at) in enumerate(zip(aside, (x, y), strict=True))
    )
    thicker = replace(sensor, skin=replace(sensor.skin, thickness=sensor.skin.thickness * (1 + more)))
    change = (loads(SkinModel(thicker), radius, x, y) - whole) / more
    for depth, q, r, dq in zip(DEPTHS[1:], whole, along, change, strict=True):
        columns = np.stack([q, 2 * q + r], axis=1)
        fit = np.linalg.lstsq(columns, dq, rcond=None)[0]
        left, alone = dq - columns @ fit, dq - q * (q @ dq) / (q @ q)
        share = 1 - left @ left / (alone @ alone)
        print(f"{depth:.1f} mm: a {fit[0]:+.2f}, k {fit[1]:+.2f}; of what a gain leaves it explains {share:.0%}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    for name, value in (("more", 0.05), ("x", 1.6), ("y", 0.7), ("radius", 4.0)):
        parser.add_argument(f"--{name}", type=float, default=value)
    main(**vars(parser.parse_args()))
