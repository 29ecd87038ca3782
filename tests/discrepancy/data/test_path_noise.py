"""Measured positions carry noise, and are sampled; commands are neither."""

import numpy as np
import pytest

from tacdata.discrepancy.data.path_noise import resolved, without_dropouts, without_noise

RATE = 100.0


def stairs(noise, seed=0, tick=0.001):
    """Ramp, wait, step and ramp back: times [ns], true and measured positions [mm]."""
    rng = np.random.default_rng(seed)
    at = np.cumsum([0, 0.5, 1.0, 2.0, 0.25, 2.0, 1.0, 0.5])
    time = np.arange(0, at[-1], 1 / RATE) + rng.uniform(-5e-4, 5e-4, int(at[-1] * RATE))
    time = np.sort(time - time[0])
    depth = np.interp(time, at, [-0.5, -0.5, 1.0, 1.0, 1.5, 1.5, -0.5, -0.5])
    read = depth + noise * rng.normal(size=len(time))
    read = np.round(read / tick) * tick if tick else read
    still = np.zeros(len(time))
    ns = np.round(time * 1e9).astype(np.int64)
    return ns, np.column_stack([still, still, depth]), np.column_stack([still, still, read])


@pytest.mark.parametrize("noise", [0.0005, 0.002, 0.01])
def test_noise_of_a_measured_position_is_told_and_taken_off(noise):
    ns, true, read = stairs(noise)
    told, found = without_noise(ns, read)
    whole = np.hypot(noise, 0.001 / np.sqrt(12))
    assert found[2] == pytest.approx(whole, rel=0.3) and not found[:2].any()
    off, before = told[:, 2] - true[:, 2], read[:, 2] - true[:, 2]
    resting = np.abs(np.gradient(true[:, 2])) < 1e-9
    assert np.sqrt(np.mean(off[resting] ** 2)) < 0.4 * np.sqrt(np.mean(before[resting] ** 2))
    assert np.abs(off).max() < 6 * whole, "corners are not rounded beyond what noise hides"
    bottom = slice(160, 340)
    rough = [np.sqrt(np.mean(np.diff(x[bottom], 2) ** 2)) for x in (told[:, 2], read[:, 2])]
    assert rough[0] < 0.3 * rough[1], "what rests does not dither"


def test_commands_stay_as_they_are():
    """Neither a path of corners nor one whose positions are merely rounded carries noise."""
    ns, true, _ = stairs(0.0)
    assert np.array_equal(without_noise(ns, np.round(true, 3))[0], np.round(true, 3))
    corners = np.array([[0, 0, -0.3], [0, 0, -0.3], [0, 0, 1.0], [0, 0, 1.0], [0, 0, -0.3]])
    at = np.cumsum([0, 5, 6, 20, 6]) * 10**8
    assert np.array_equal(without_noise(at, corners)[0], corners)
    assert resolved(at, corners[:, 2], np.arange(0, at[-1], 10**7)).all()


def test_a_path_that_bends_has_no_noise():
    """A fast sine, sampled seldom: every position is far off the line between its neighbours, and all alike."""
    time = np.arange(0, 12, 0.04)
    path = np.column_stack([0 * time, 0 * time, 1 - np.cos(6 * time)])
    told, found = without_noise(np.round(time * 1e9).astype(np.int64), path)
    assert found[2] < 0.001 and np.abs(told - path).max() < 0.002


@pytest.mark.parametrize(("speed", "known"), [(0.5, True), (8.0, False)])
def test_readings_beside_a_corner_that_positions_leave_out_are_not_known(speed, known):
    """A ramp of 8 mm/s sampled 25 times a second turns by 0.3 mm between two positions."""
    time = np.arange(0, 4, 0.04)
    depth = np.interp(time, [1, 1 + 2 / speed], [0, 2.0])
    ns = np.round(time * 1e9).astype(np.int64)
    asked = np.arange(0, int(4e9), 10**7)
    told = resolved(ns, depth, asked)
    assert told.all() == known
    if not known:
        assert not told[np.abs(asked - 1e9) < 3e7].any(), "beside the corner"
        assert told[np.abs(asked - 1e9) > 5e8].all(), "elsewhere"


def test_single_zeros_of_a_position_are_set_aside_and_nothing_else():
    """Each would cut a press in two; a path that is given by its corners turns at single positions."""
    time, _, read = stairs(0.002)
    path = read + np.array([3.0, -1.0, 0.0])
    holes = [60, 180, 333]
    torn = path.copy()
    torn[holes] = 0.0
    mended, lost = without_dropouts(time, torn)
    assert lost == 3 and np.abs(mended - path).max() < 0.02
    assert without_dropouts(time, path)[1] == 0
    corners = np.tile([[0.0, 0, -0.3], [0, 0, 1.0], [0, 0, -0.3], [0, 0, -0.3]], (50, 1))
    at = np.cumsum(np.tile([1.0, 1.0, 1.0, 9.0], 50)) * 1e9
    assert without_dropouts(at, corners)[1] == 0
