"""Noise is drawn as the noise model says it: whitening undoes it."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.judge import judge
from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.noise.noise_model import Noise
from tacdata.discrepancy.noise.readings import median_step
from tacdata.discrepancy.noise.whitener import whiten


def coloured(white, reduced, noise):
    """Return noise as readings have it: each row keeps a share of the one before; an average scatters less."""
    made = white * noise.scale[None, :, None]
    for row in range(reduced.rows):
        keep = 0.0 if reduced.first[row] else noise.memory ** (reduced.step[row] / noise.step)
        made[row] *= np.sqrt((1 - keep**2) / (1 - noise.memory**2) / min(reduced.averaged[row], 4))
        if keep:
            made[row] += keep * made[row - 1]
    return made if noise.relative_scale is None else made * noise.relative_scale[:, :, None]


@pytest.mark.parametrize("louder", [False, True])
def test_whitening_undoes_colour(louder):
    reduced = course(episodes=4).reduced
    rng = np.random.default_rng(1)
    white = rng.normal(size=(reduced.rows, 3, 2))
    relative = rng.uniform(1, 3, (reduced.rows, 3)) if louder else None
    noise = Noise(np.array([2.0, 1.0, 0.5]), 0.6, median_step(reduced), relative_scale=relative)
    assert whiten(coloured(white.copy(), reduced, noise), reduced, noise) == pytest.approx(white, abs=1e-4)


def test_successive_readings_have_in_common_what_the_noise_says():
    reduced = course(episodes=4).reduced
    noise = Noise(np.ones(3), 0.6, median_step(reduced))
    drawn = coloured(np.random.default_rng(1).normal(size=(reduced.rows, 3, 2)), reduced, noise)
    moving = np.flatnonzero(~reduced.first & (reduced.averaged == 1) & (np.roll(reduced.averaged, 1) == 1))
    assert np.mean(drawn[moving] * drawn[moving - 1]) / np.mean(drawn[moving] ** 2) == pytest.approx(0.6, abs=0.1)


def test_noise_of_some_rows_keeps_what_belongs_to_them():
    rng, rows = np.random.default_rng(2), np.arange(10) % 3 > 0
    whole = Noise(
        np.ones(2),
        0.3,
        0.02,
        gain_error=rng.normal(size=(10, 2)),
        missing=rng.random((10, 2)) > 0.5,
        random_walk=rng.normal(size=(10, 4)),
        relative_scale=1 + rng.random((10, 2)),
    )
    some = whole.of(rows)
    for name in ("gain_error", "missing", "random_walk", "relative_scale"):
        assert np.array_equal(getattr(some, name), getattr(whole, name)[rows]), name
    assert some.memory == 0.3 and some.offsets is None


def test_a_press_is_whitened_alike_whatever_others_stand_beside_it():
    """Most others are slower: the median step is theirs. The memory of noise is not."""
    reduced = course(episodes=4).reduced
    noise, values = (
        Noise(np.ones(3), 0.6, median_step(reduced)),
        np.random.default_rng(3).normal(size=(reduced.rows, 3, 1)),
    )
    slower = replace(reduced, time=reduced.time * np.where(reduced.episode > 0, 5.0, 1.0))
    assert median_step(slower) > 3 * median_step(reduced)
    own = reduced.episode == 0
    assert whiten(values, slower, noise)[own] == pytest.approx(whiten(values, reduced, noise)[own], abs=1e-6)


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("powers", [(0, -21, 0), (0, 0, 21), (-12, 0, 9)])
def test_units_of_channels_that_are_far_apart_change_no_gap(powers):
    """A square of 1e21 is beyond single precision."""
    made = course(seed=1, episodes=24)
    found = [
        judge(replace(made, readings=made.readings * unit), read_spec(None), until="gate").document["gate"]["p"]
        for unit in (1.0, 10.0 ** np.array(powers, dtype=float))
    ]
    assert found[1] == pytest.approx(found[0], abs=0.1)
