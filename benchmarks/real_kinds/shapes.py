"""Shapes of a real skin's residual from a curve of depth: python shapes.py ../../../shared/data/eflesh_magnetic.

Thirty cycles of a printed magnetic skin, fourteen channels (github.com/notvenky/eFlesh, MIT). Of each cycle is kept
the residual from the mean of both ways over all cycles, over the channel's range, at 33 depths down and 33 up.
Principal components of them all go to `shapes.csv`, a row each.
"""

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

KEPT = 6
POINTS = 33
FILE = Path(__file__).with_name("shapes.csv")


def cycles(folder):
    """Return readings by depth of every cycle, shape (cycles, channels, 2 POINTS)."""
    read = np.loadtxt(folder / "sensor.csv", delimiter=",")
    path = np.loadtxt(folder / "states.csv", delimiter=",")
    depth = -np.interp(read[:, 0], path[:, 0], path[:, 3])
    share = (depth - depth.min()) / np.ptp(depth)
    tops, deep = [], False
    for k, value in enumerate(share):
        if value > 0.9 and not deep:
            tops.append(k)
        deep = value > 0.1 and (deep or value > 0.9)
    lows = [0, *(a + int(np.argmin(share[a:b])) for a, b in pairwise(tops)), len(share)]
    at, found = np.linspace(0, 1, POINTS), []
    for a, b in pairwise(lows):
        top = a + int(np.argmax(share[a:b]))
        ways = (slice(a, top + 1), slice(b - 1, top - 1 if top else None, -1))
        each = [[np.interp(at, np.maximum.accumulate(share[w]), c) for c in read[w, 1:].T] for w in ways]
        found.append(np.concatenate(each, axis=1))
    return np.array(found) - np.array(found)[:, :, :1]


def main(data):
    """Write the shapes."""
    rows = []
    for folder in sorted((data / "normal_force").iterdir()):
        found = cycles(folder)
        size = np.ptp(found.mean(axis=0), axis=1)
        mean = 0.5 * (found[:, :, :POINTS] + found[:, :, POINTS:]).mean(axis=0)
        left = (found - np.concatenate([mean, mean], axis=1)) / size[None, :, None]
        rows.append(left[:, size > 0.1 * size.max()].reshape(-1, 2 * POINTS))
    shapes = np.linalg.svd(np.concatenate(rows), full_matrices=False)[2][:KEPT]
    np.savetxt(FILE, shapes, delimiter=",", fmt="%.4f")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
