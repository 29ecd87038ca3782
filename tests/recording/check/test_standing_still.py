"""A controller that stood still is noticed; one that made many short moves is not accused of it."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tacdata.recording.check.alignment import stood_still

MS = 1_000_000


def strokes(late=0):
    """Return figures of 30 strokes of 0.2 mm, a report every 125 ms amid a move, one answer ``late`` [ms]."""
    moves, now = [], 0
    for k in range(60):
        target = np.array([0.0, 0.0, -0.6 if k % 2 == 0 else -0.8])
        moves.append(
            SimpleNamespace(
                start_ns=now,
                end_ns=now + 50 * MS,
                command=SimpleNamespace(phase="press", sent_ns=now, target=target),
                profile=SimpleNamespace(target=target, length=0.2),
            )
        )
        now += (100 + (late if k == 20 else 0)) * MS
    arrival = np.arange(0, now, 125 * MS)
    episode = SimpleNamespace(
        complete=True,
        press=SimpleNamespace(hold=0.0),
        phases=(SimpleNamespace(name="hold", end_ns=now),),
        cnc=SimpleNamespace(arrival_ns=arrival, position=np.tile([0.0, 0.0, -0.7], (len(arrival), 1))),
        taxels=SimpleNamespace(arrival_ns=np.arange(0, now, 33 * MS)),
    )
    recording = SimpleNamespace(episode=episode, moves=moves, height_resolution=0.003)
    return cast(Any, SimpleNamespace(recording=recording))


@pytest.mark.parametrize(("late", "still"), [(0, 0.0), (900, 950.0)])
def test_strokes_end_when_the_pause_behind_them_is_answered(late, still):
    """Reports come between the turns: none shows where a stroke ended."""
    assert stood_still(strokes(late), 1.0) == pytest.approx(still)
