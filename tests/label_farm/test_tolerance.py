"""States are added where a path bends, on the branch where it does, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from farm_examples import SENSOR
from fast_model import path

from label_farm.fem import FemModel
from label_farm.job import Job
from label_farm.ladder import Ladder
from label_farm.tolerance import Tolerance
from tacdata.errors import UsageError

STRICT = Tolerance(0.01, 0.005)


def kink(depth):
    """Nothing until 0.6 mm, then everything."""
    return 2 * max(0.0, depth - 0.6)


def test_a_straight_path_needs_no_more_states():
    states = path(SENSOR, Ladder().depths(1.5), lambda d: d)
    assert STRICT.refined(states.depth, states.surface) == tuple(states.depth)
    assert STRICT.exceeded(states.depth, states.surface) < 1e-9


def test_states_are_added_beside_a_kink_and_not_far_from_it():
    depths = Ladder().depths(1.5)
    states = path(SENSOR, depths, kink)
    assert STRICT.exceeded(states.depth, states.surface) > 2
    more = STRICT.refined(states.depth, states.surface)
    assert set(depths) < set(more)
    added = np.array(sorted(set(more) - set(depths)))
    assert len(added) >= 3 and 0.15 < added.min() and added.max() < 1.3
    better = path(SENSOR, more, kink)
    assert STRICT.exceeded(better.depth, better.surface) < 0.6 * STRICT.exceeded(states.depth, states.surface)
    assert more[0] == more[-1] == 0 and max(more) == 1.5


def test_a_branch_that_bends_is_refined_alone():
    """Friction makes unloading another path than loading."""
    depths = Ladder().depths(1.2)
    states = path(SENSOR, depths, lambda d: d)
    peak = int(np.argmax(depths))
    surface = states.surface.copy()
    surface[peak:] *= (np.array([kink(d) for d in depths[peak:]]) / np.maximum(depths[peak:], 1e-9))[:, None, None]
    surface[peak] = states.surface[peak]
    more = STRICT.refined(states.depth, surface)
    deepest = more.index(1.2)
    assert more[: deepest + 1] == depths[: peak + 1]
    assert len(more) - deepest > len(depths) - peak


def test_steps_are_not_split_beyond_sense():
    states = path(SENSOR, (0.0, 0.01, 0.04, 1.0, 0.04, 0.01, 0.0), lambda d: d**0.2)
    more = STRICT.refined(states.depth, states.surface)
    steps = np.abs(np.diff(more))
    assert len(more) <= 1 + 4 * 6 and np.isclose(steps, 0.01).sum() == 2
    assert steps[steps > 0.0101].min() > 0.014


def test_a_shape_that_falls_between_the_pixels_still_counts():
    states = path(SENSOR, Ladder().depths(1.0), kink)
    sharp = 0.05 * states.surface
    assert not (sharp > 0.1).any()
    assert STRICT.exceeded(states.depth, sharp) > 0


@pytest.mark.parametrize("values", [(0.01, 0.0), (-0.1, 0.005), (0.01, float("nan")), (float("inf"), 1.0)])
def test_impossible_tolerances_are_refused(values):
    with pytest.raises(UsageError, match="tolerance"):
        Tolerance(*values)


def test_a_job_is_named_by_its_tolerance_too():
    job = Job(SENSOR.content_hash, "a" * 64, {"shape": "sphere", "radius": 2.0}, 0.5, 0.0, 0.0, (0.0, 1.0, 0.0))
    strict, loose = replace(job, tolerance=STRICT), replace(job, tolerance=Tolerance(0.05, 0.05))
    assert len({job.key, strict.key, loose.key}) == 3
    for wish in (job, strict):
        assert Job.from_document(wish.document) == wish


class Kinked:
    """A skin whose paths have a kink; it counts how often it is asked."""

    def __init__(self):
        self.sensor, self.asked = replace(SENSOR, uncertainty={}), []

    def solve(self, press):
        self.asked.append(press.depths)
        return path(SENSOR, press.depths, kink)


def test_the_model_solves_again_until_the_states_are_near_enough_or_three_times():
    model = FemModel.__new__(FemModel)
    ladder = Ladder()
    job = Job(
        SENSOR.content_hash,
        "a" * 64,
        {"shape": "sphere", "radius": 2.0},
        0.5,
        0.0,
        0.0,
        ladder.depths(1.5),
        ladder.tolerance,
    )
    model._model = Kinked()
    found = model.solve(job)
    asked = model._model.asked
    assert 2 <= len(asked) <= 3 and len(asked[-1]) > len(asked[0])
    assert tuple(found.depth) == asked[-1]
    said = found.provenance["ladder"]
    assert said["asked"] == len(asked[0]) and said["states"] == len(asked[-1])
    assert said["left_out_over_tolerance"] == pytest.approx(STRICT.exceeded(found.depth, found.surface), abs=1e-3)
    model._model = Kinked()
    model.solve(replace(job, tolerance=None))
    assert model._model.asked == [job.depths]
