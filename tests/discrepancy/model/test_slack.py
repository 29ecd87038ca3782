"""One-sided contact: readings of a strip that is slack say nothing of its memory."""

import numpy as np
import pytest

from tacdata.chain import Course, Tool
from tacdata.discrepancy.model.slack import slack_rows, without_slack


def strokes(lag: float, one_sided: bool, offset: float = 0.0, presses: int = 6) -> Course:
    """Return strokes of a strip with a loop: on the way back the force is less by ``lag`` of its largest."""
    rng, way = np.random.default_rng(1), np.concatenate([np.linspace(0, 1, 100), np.linspace(1, 0, 100)[1:]])
    depth = np.concatenate([way * (40 + 20 * k) for k in range(presses)])
    episode, back = np.repeat(np.arange(presses), len(way)), np.tile(np.arange(len(way)) >= 100, presses)
    force = depth / 140 - lag * back * np.minimum(1.0, (40 + 20 * episode - depth) / 10) * (40 + 20 * episode) / 140
    force = np.maximum(force, 0.0) if one_sided else force
    readings = offset + force + 0.002 * rng.normal(size=len(depth))
    return Course(
        time=np.arange(len(depth)) * 0.1,
        episode=episode,
        tip=np.column_stack([0 * depth, 0 * depth, depth]),
        tool=np.zeros(len(depth), dtype=int),
        readings=readings[:, None],
        averaged=np.ones(len(depth)),
        session=np.zeros(presses, dtype=int),
        site=np.zeros(presses, dtype=int),
        tools=(Tool("clamp", "unknown", float("nan")),),
        names=tuple(f"stroke {k}" for k in range(presses)),
    )


@pytest.mark.parametrize("offset", [0.0, 512.0])
def test_readings_at_rest_on_the_way_back_are_left_out(offset):
    course = strokes(0.2, one_sided=True, offset=offset)
    slack, depth = slack_rows(course)[:, 0], course.tip[:, 2]
    edge = 0.2 * (40 + 20 * course.episode)  # the strip is slack below
    back = np.concatenate([[False], np.diff(depth) < 0]) & ~course.first
    np.testing.assert_array_equal(slack[back & (depth > 1.3 * edge)], False)
    assert slack[back & (depth < 0.6 * edge)].mean() > 0.9
    assert not slack[~back].any()
    assert "slack" in without_slack(course).notes[-1]


def test_contact_that_holds_both_ways_has_no_slack():
    assert not slack_rows(strokes(0.2, one_sided=False)).any()


def test_a_loop_that_closes_with_the_path_has_no_slack():
    course = strokes(0.0, one_sided=True)
    assert not slack_rows(course).any()
    assert without_slack(course) is course
