"""One press on its way: which depth to try next, when a state counts as found, when to give up."""

import math

import pytest

from tacdata.errors import SolveError
from tacdata.skin.solve.load_path import LoadPath
from tacdata.skin.solve.settings import SolverSettings

LIMIT = SolverSettings()
GOOD = (LIMIT.residual / 2, 0.0, 0.0, 1.0)
"""Error, largest and mean penetration and volume of a state that is found."""


def walk(*depths, longest=0.25):
    return LoadPath(depths, longest, "sphere at (1, 2) mm")


def judged(way, error, largest, mean):
    """Verdict on a state 0.2 mm deep, its figures as shares of what is allowed."""
    deep = (0.2 * LIMIT.penetration, 0.2 * LIMIT.mean_penetration)
    return step(way, error * LIMIT.residual, largest * deep[0], mean * deep[1], 1.0)


def step(way, *figures, limit=LIMIT):
    """Verdict on a state, and the Newton step that follows where it says so."""
    verdict = way.judge(*figures, limit)
    if verdict == "go on":
        way.stepped()
    return verdict


def path(way):
    """Every depth tried, all found at once; and those that are handed out."""
    tried, wanted = [], []
    while not way.finished:
        assert way.judge(*GOOD, LIMIT) == "found"
        tried.append(way.attempt)
        if way.found():
            wanted.append(way.depth)
        if not way.finished:
            way.go_on()
    return tried, wanted


def test_steps_are_bounded_and_end_at_the_depths_wanted():
    tried, wanted = path(walk(0.6, 0.1))
    assert tried == pytest.approx([0.25, 0.5, 0.6, 0.1])
    assert wanted == [0.6, 0.1]


def test_the_way_up_has_a_bound_of_its_own():
    way = LoadPath((0.5, 0.0), 0.25, "sphere", lift=0.2)
    assert path(way)[0] == pytest.approx([0.25, 0.5, 0.3, 0.1, 0.0])
    way = LoadPath((0.5, 0.0), 0.25, "sphere")
    for _ in range(2):
        way.found()
        way.go_on()
    assert way.attempt == 0.0
    way.halve()
    assert way.attempt == pytest.approx(0.25), "also a step up is halved where no equilibrium is found"


def test_the_first_step_onto_an_edge_is_a_short_one():
    way = LoadPath((0.6,), 0.25, "flat punch", first=0.06)
    assert path(way)[0] == pytest.approx([0.06, 0.18, 0.42, 0.6])


def test_a_depth_wanted_twice_is_found_twice():
    tried, wanted = path(walk(0.0, 0.2, 0.2, 0.0))
    assert tried == wanted == [0.0, 0.2, 0.2, 0.0]


def test_the_direction_is_that_of_the_last_movement():
    way = walk(0.2, 0.2, 0.1)
    directions = []
    while not way.finished:
        way.found()
        directions.append(math.copysign(1, way.direction))
        if not way.finished:
            way.go_on()
    assert directions == [1, 1, -1]


def test_a_state_is_found_only_if_balanced_and_without_penetration():
    way = walk(0.2)
    balanced, tight = LIMIT.residual, LIMIT.penetration * 0.2
    assert way.judge(1.01 * balanced, tight, 0.0, 1.0, LIMIT) == "go on"
    assert way.judge(balanced, 1.01 * tight, 0.0, 1.0, LIMIT) == "go on"
    assert way.judge(balanced, tight, 0.0, 1.0, LIMIT) == "found"


def test_points_that_penetrate_together_count_for_more_than_one_at_the_edge():
    way, mean = walk(0.2), LIMIT.mean_penetration * 0.2
    assert LIMIT.mean_penetration < LIMIT.penetration
    assert way.judge(LIMIT.residual, mean, 1.01 * mean, 1.0, LIMIT) == "go on"
    assert way.judge(LIMIT.residual, mean, mean, 1.0, LIMIT) == "found"


def test_penetration_is_judged_by_a_tenth_of_a_millimetre_where_a_press_is_shallower():
    allowed = LIMIT.penetration * 0.1
    assert walk(0.01).judge(0.0, allowed, 0.0, 1.0, LIMIT) == "found"
    assert walk(0.01).judge(0.0, 1.01 * allowed, 0.0, 1.0, LIMIT) == "go on"


def test_iterations_without_progress_end_the_attempt():
    """Counted from the first step on: what stands before it is a guess, and no figure to be compared with."""
    way = walk(0.2)
    verdicts = [step(way, 1.0, 0.0, 0.0, 0.5) for _ in range(LIMIT.patience + 3)]
    assert verdicts[:-1] == ["go on"] * (LIMIT.patience + 2)
    assert verdicts[-1] == "failed"
    assert "residual is 1.0e+00" in way.reason and "det F 0.50" in way.reason


def test_slow_progress_is_let_go_on_up_to_the_limit():
    way, error, count = walk(0.2), 1.0, 0
    while step(way, error, 0.0, 0.0, 1.0, limit=SolverSettings(residual=1e-30)) == "go on":
        error, count = 0.8 * error, count + 1
    assert count == LIMIT.newton_limit
    assert f"{LIMIT.newton_limit} Newton iterations" in way.reason


def test_a_guess_better_than_the_first_step_is_no_figure_to_be_beaten():
    """The first step changes the active set, and may leave more than the guess: progress is measured from there."""
    way, error = walk(0.2), 0.1
    assert step(way, 0.01, 0.0, 0.0, 1.0) == "go on"
    for _ in range(LIMIT.patience + 4):
        assert step(way, error, 0.0, 0.0, 1.0) == "go on"
        error *= 0.88
    assert error > 0.01


@pytest.mark.parametrize("which", [0, 1, 2])
def test_progress_is_that_of_what_is_farthest_from_what_is_allowed(which):
    """Penetration and its mean go on falling while forces balance already, and count; what stands still counts not."""
    falling, fixed, size, verdicts = walk(0.2), walk(0.2), 1000.0, []
    for _ in range(LIMIT.patience + 3):
        assert judged(falling, *(size if k == which else 0.5 for k in range(3))) == "go on"
        verdicts.append(judged(fixed, *(1000.0 if k == which else size / 2000 for k in range(3))))
        size *= 0.8
    assert verdicts == ["go on"] * (LIMIT.patience + 2) + ["failed"]


@pytest.mark.parametrize("error", [math.nan, math.inf])
def test_a_state_that_is_no_number_fails_at_once(error):
    way = walk(0.2)
    assert way.judge(error, 0.0, 0.0, 1.0, LIMIT) == "failed"
    assert way.judge(0.0, math.nan, 0.0, 1.0, LIMIT) != "found"


def test_iterations_are_counted_over_failed_attempts():
    way = walk(0.2)
    for _ in range(3):
        step(way, 1.0, 0.0, 0.0, 1.0)
    way.halve()
    step(way, 1.0, 0.0, 0.0, 1.0)
    assert (way.newton, way.spent) == (1, 4)


def test_a_failed_step_is_halved_and_grows_again():
    way = walk(0.4, 0.8)
    way.halve()
    assert way.attempt == pytest.approx(0.125)
    tried, wanted = path(way)
    assert tried == pytest.approx([0.125, 0.375, 0.4, 0.65, 0.8])
    assert wanted == [0.4, 0.8]


def test_a_step_on_the_way_back_is_halved_too():
    way = walk(0.2, 0.0)
    way.found()
    way.go_on()
    way.halve()
    assert way.attempt == pytest.approx(0.1)


def test_a_press_is_given_up_in_words_when_steps_become_tiny():
    way = walk(0.25, 0.5)
    way.found()
    way.go_on()
    way.judge(math.nan, 0.0, 0.0, 0.3, LIMIT)
    for _ in range(3):
        way.halve()
    words = r"sphere at \(1, 2\) mm: no equilibrium beyond depth 0\.250 mm; after"
    with pytest.raises(SolveError, match=words) as caught:
        for _ in range(3):
            way.halve()
    assert "reduce the depth" in str(caught.value)


def test_a_depth_that_is_where_it_stands_cannot_be_approached_in_smaller_steps():
    with pytest.raises(SolveError, match="no equilibrium"):
        walk(0.0).halve()


def test_a_press_that_passes_through_its_shape_at_every_step_ends_with_that_reason():
    way = walk(0.2)
    way.passed_through()
    with pytest.raises(SolveError, match=r"at 0\.200 mm the skin has passed through the indenter"):
        for _ in range(20):
            way.halve()
