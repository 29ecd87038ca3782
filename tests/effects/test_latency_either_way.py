"""Onset and recovery may come late by times of their own."""

from typing import Any, cast

import numpy as np
import pytest

from tacdata.chain import Course, State
from tacdata.effects import load


def late(onset, recovery, sign=1.0):
    """A triangle of 4 s through the effect: by how much its rise and its fall are late [s]."""
    time = np.arange(0.0, 8.0, 0.01)
    triangle = sign * np.interp(time, [1.0, 3.0, 5.0], [0.0, 2.0, 0.0])
    n = len(time)
    course = Course(
        time=time,
        episode=np.zeros(n, dtype=int),
        tip=np.zeros((n, 3)),
        tool=np.zeros(n, dtype=int),
        readings=np.zeros((n, 1)),
        averaged=np.ones(n),
        session=np.zeros(1, dtype=int),
        site=np.zeros(1, dtype=int),
        tools=(),
        names=("one",),
    )
    signal = 7.0 + triangle[:, None]
    state = State(course, cast(Any, None), np.zeros((n, 3)), triangle[:, None], triangle, signal)
    values = {"L_in": np.array(onset), "L_out": np.array(recovery)}
    read = sign * (load("latency_either_way").apply(state, values).signal[:, 0] - 7.0)
    top = int(np.argmax(read))
    rise = float(np.interp(1.0, read[:top], time[:top])) - 2.0
    return rise, float(np.interp(-1.0, -read[top:], time[top:])) - 4.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("onset", "recovery"), [(0.2, 0.5), (0.4, 0.1), (0.3, 0.3), (0.0, 0.2)])
def test_each_edge_is_late_by_its_own_time(onset, recovery, sign):
    assert late(onset, recovery, sign) == pytest.approx((onset, recovery), abs=0.01)


def test_equal_times_are_the_plain_delay():
    values = {"L_in": np.array(0.1), "L_out": np.array(0.3)}
    assert load("latency_either_way").delay(values) == pytest.approx(0.2)
    assert "0.10 s late while load rises and 0.30 s" in load("latency_either_way").remark(values)
    assert load("latency_either_way").remark({"L_in": np.array(0.1), "L_out": np.array(0.2)}) == ""
