"""States are added where a path bends, on the branch where it does, and nowhere else."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from farm_examples import SENSOR
from fast_model import path

from tacdata.errors import UsageError
from tacdata.label_farm.presses.fem import FemModel
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.presses.ladder import Ladder
from tacdata.label_farm.presses.tolerance import Tolerance

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


@dataclass(frozen=True)
class Coarse:
    """What a coarser mesh says of the loading."""

    figures: object


class Kinked:
    """A skin whose paths have a kink; it counts what it is asked."""

    def __init__(self, foresees=True):
        self.sensor, self.foresees = replace(SENSOR, uncertainty={}), foresees
        self.asked, self.asked_coarsely, self.given = [], [], []

    def solve_coarsely(self, requests, capacity):
        self.asked_coarsely += [press.depths for press in requests]
        return [Coarse(self.loading(press.depths)) if self.foresees else None for press in requests]

    @staticmethod
    def loading(depths):
        return path(SENSOR, depths[1 : int(np.argmax(depths)) + 1], kink)

    def solve_many(self, requests, capacity, coarse):
        for number, press in enumerate(requests):
            self.asked.append(press.depths)
            self.given.append(coarse[number])
            yield number, path(SENSOR, press.depths, kink)


def farm_model(**given):
    model = FemModel.__new__(FemModel)
    model._model, model.batch = Kinked(**given), 4
    return model, model._model


def job_of(depth=1.5, **more):
    ladder = Ladder()
    sphere = {"shape": "sphere", "radius": 2.0}
    made = Job(SENSOR.content_hash, "a" * 64, sphere, 0.5, 0.0, 0.0, ladder.depths(depth), ladder.tolerance)
    return replace(made, **more)


def test_a_rougher_model_foretells_where_states_are_needed_on_the_way_down():
    depths = Ladder().depths(1.5)
    rough = Kinked.loading(depths)
    more = STRICT.foretold(depths, rough.depth, rough.surface)
    states = path(SENSOR, depths, kink)
    known = STRICT.refined(states.depth, states.surface)
    assert set(depths) < set(more) and set(known) - set(depths) <= set(more)
    peak, before = int(np.argmax(more)), int(np.argmax(depths))
    assert np.all(np.diff(more[: peak + 1]) > 0)
    assert more[peak:] == depths[before:], "the way up is told by its difference from the way down"
    assert STRICT.foretold(depths, np.zeros(0), np.zeros((0, *SENSOR.map.shape))) == depths


def test_a_path_is_solved_once_where_the_coarser_mesh_foretold_it():
    model, skin = farm_model()
    found = model.solve(job_of(tolerance=Tolerance(0.02, 0.02)))
    [asked], [coarsely] = skin.asked, skin.asked_coarsely
    assert len(asked) > len(coarsely) and tuple(found.depth) == asked
    assert found.provenance["ladder"]["left_out_over_tolerance"] <= 1


def test_without_a_coarser_mesh_a_path_is_solved_again_and_the_coarse_one_never():
    model, skin = farm_model(foresees=False)
    job = job_of()
    found = model.solve(job)
    assert len(skin.asked) == 2 and len(skin.asked[1]) > len(skin.asked[0]) and len(skin.asked_coarsely) == 1
    assert tuple(found.depth) == skin.asked[-1]
    said = found.provenance["ladder"]
    assert said["asked"] == len(skin.asked[0]) and said["states"] == len(skin.asked[-1])
    assert said["left_out_over_tolerance"] == pytest.approx(STRICT.exceeded(found.depth, found.surface), abs=1e-3)
    model, skin = farm_model()
    model.solve(replace(job, tolerance=None))
    assert skin.asked == [job.depths]


def test_each_press_keeps_what_the_coarser_mesh_said_of_it():
    model, skin = farm_model()
    jobs = [job_of(depth, tolerance=Tolerance(0.001, 0.001)) for depth in (0.7, 1.5)]
    assert {job.deepest for job, _ in model.solve_many(jobs)} == {0.7, 1.5}
    for depths, coarse in zip(skin.asked, skin.given, strict=True):
        assert max(depths) == coarse.figures.depth[-1]
