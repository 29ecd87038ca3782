"""Noise is drawn as the noise model says it: whitening undoes it."""

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.evidence import Noise, coloured, whiten


def test_whitening_undoes_colour():
    reduced = course(episodes=4).reduced
    noise = Noise(np.array([2.0, 1.0, 0.5]), 0.6)
    white = np.random.default_rng(1).normal(size=(reduced.rows, 3, 2))
    drawn = coloured(white, reduced, noise)
    assert whiten(drawn, reduced, noise) == pytest.approx(white, abs=1e-4)
    moving = np.flatnonzero(~reduced.first & (reduced.averaged == 1) & (np.roll(reduced.averaged, 1) == 1))
    together = np.mean(drawn[moving, 0] * drawn[moving - 1, 0]) / np.mean(drawn[moving, 0] ** 2)
    assert together == pytest.approx(0.6, abs=0.1), "successive readings have so much in common"
