"""Readings without any noise, as simulated files have: rounding is no evidence."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course
from test_judge import judged

from tacdata.chain.rows import rows_of

DELAY = 0.1
"""Of the readings [s]."""


def noiseless(episodes, copies):
    """Return equal presses whose readings are the depth a delay ago; all channels are multiples of one."""
    time = np.arange(0, 6, 0.02)
    at, path = np.array([0, 1.2, 2.7, 3.6, 5.1, 6.0]), np.array([0, 0, 2.0, 2.0, 0, 0])
    values = np.interp(time - DELAY, at, path)[:, None] * np.arange(1, 1 + copies)
    rows = rows_of(time, values, time, np.column_stack([0 * time, 0 * time, np.interp(time, at, path)]))
    return replace(
        course(episodes=episodes),
        time=np.concatenate([6 * k + rows.time for k in range(episodes)]),
        episode=np.repeat(np.arange(episodes), len(rows.time)),
        tip=np.concatenate([rows.tip] * episodes),
        tool=np.zeros(episodes * len(rows.time), dtype=int),
        readings=np.concatenate([rows.values] * episodes),
        averaged=np.concatenate([rows.averaged] * episodes),
        site=np.zeros(episodes, dtype=int),
    )


def test_a_delay_is_measured_in_readings_without_noise():
    answer = judged(made=noiseless(episodes=10, copies=3))
    assert answer.names == {"latency"}
    assert answer.decision.effects[0].finding.placed.values["L"] == pytest.approx(DELAY, rel=0.02)
