"""Where a report may say that the guide is, by the moves that were sent and the times of both."""

import numpy as np
import pytest
from recording_examples import LIMITS

from tacdata.devices.device import CncStatus
from tacdata.recording.motion.allowed_path import TOLERANCE, AllowedPath

T = 1_000_000_000_000
S = 1_000_000_000
HIGH, LOW = (10.0, 20.0, -20.0), (10.0, 20.0, -25.0)


@pytest.fixture
def path():
    path = AllowedPath(LIMITS, 0.003)
    path.stand(HIGH, T)
    return path


def second(path, *report_of):
    """Judge a report that is preceded by one a moment earlier."""
    path.off(report(report_of[0] - 0.004, *report_of[1:]))
    return path.off(report(*report_of))


def report(seconds, *position, trip=0.01):
    """A report that arrived so long after `T` [s] and took ``trip`` [s]."""
    return CncStatus(T + round((seconds - trip) * S), T + round(seconds * S), "Run", np.array(position, float), 0.0)


def test_without_a_known_place_everything_is_allowed():
    unknown = AllowedPath(LIMITS, 0.003)
    unknown.move(LOW, 1.0, T)
    assert second(unknown, 1, 0, 0, 0) is None


def test_at_rest_only_the_place_is_allowed(path):
    assert second(path, 1, *HIGH) is None
    assert second(path, 1, 10.0, 20.0, -20.0 - TOLERANCE) is None
    assert "0.10 mm off its way" in second(path, 1, 10.0, 20.1, -20.0).given
    path.forget()
    assert second(path, 1, 10.0, 20.1, -20.0) is None


@pytest.mark.parametrize(
    ("seconds", "z", "words"),
    [
        (3.0, -21.0, None),  # slower than it may: a line that came late
        (3.0, -21.95, None),
        (3.0, -24.0, "farther on its way"),
        (20.0, -25.0, None),
        (20.0, -25.5, "0.50 mm off"),
        (20.0, -19.5, "0.50 mm off"),
    ],
)
def test_of_a_move_only_what_its_speed_allows_since_it_was_sent(path, seconds, z, words):
    path.move(LOW, 1.0, T + S)
    found = second(path, seconds, 10.0, 20.0, z)
    assert (found is None) if words is None else words in found.given


def test_a_move_that_has_ended_leaves_its_end_only(path):
    path.move(LOW, 1.0, T + S)
    path.rested(T + 7 * S)
    assert second(path, 7.005, 10.0, 20.0, -24.0) is None, "asked for before the end was known"
    assert second(path, 8, *LOW) is None
    assert second(path, 8, 10.0, 20.0, -24.0) is not None


def test_a_report_that_no_machine_can_have_earned_names_its_line(path):
    assert second(path, 1.0, *HIGH) is None
    found = second(path, 1.1, 10.0, 20.0, 20.0)
    assert "(10.00, 20.00, 20.00) mm" in found.given
    assert "farther than it can have moved" in found.given
    assert "damaged on its way" in found.remedy


def test_a_move_still_under_way_though_it_was_answered_says_so(path):
    path.move(LOW, 1.0, T)
    path.rested(T + S)  # an answer that no firmware gave
    path.move((10.0, 20.0, -21.0), 1.0, T + S)
    found = second(path, 2.0, 10.0, 20.0, -22.0)
    assert "still on its way from (10.00, 20.00, -20.00) to (10.00, 20.00, -25.00) mm, which an answer" in found.given
    assert "no second controller" in found.remedy
    assert "off its way" in second(path, 3.0, 10.5, 20.0, -22.0).given, "elsewhere is elsewhere"


def test_two_moves_may_be_under_way_at_once(path):
    path.move(LOW, 5.0, T)
    path.move((15.0, 20.0, -25.0), 5.0, T)
    for place in (HIGH, LOW, (10.0, 20.0, -22.0), (15.0, 20.0, -25.0), (12.0, 20.0, -25.0)):
        assert second(path, 9, *place) is None
    assert second(path, 9, 12.0, 20.0, -22.0) is not None


def test_a_report_from_before_a_move_does_not_accuse_it(path):
    path.move(LOW, 1.0, T + S)
    path.rested(T + 7 * S)
    path.move(HIGH, 1.0, T + 9 * S)
    assert second(path, 8.5, *LOW) is None


def test_reports_that_are_no_position_are_off(path):
    assert second(path, 1, np.nan, np.nan, np.nan) is not None


def test_a_report_that_is_read_late_belongs_to_its_own_time(path):
    path.move(LOW, 5.0, T + S)
    path.rested(T + 3 * S)
    path.stand(LOW, T + 4 * S)
    path.move(HIGH, 5.0, T + 4 * S)
    assert second(path, 1.3, 10.0, 20.0, -20.5) is None, "the moves that led here are kept"
    assert second(path, 3.5, *LOW) is None, "at rest between two moves"
    assert second(path, 3.5, *HIGH) is not None
    path.stand((0.0, 0.0, 0.0), T + 9 * S)
    assert second(path, 1.3, 10.0, 20.0, -20.5) is None, "what came before a new beginning is not judged"
    assert second(path, 9.5, *HIGH) is not None


def test_moves_that_take_far_longer_than_they_should_are_behind(path):
    path.move(LOW, 1.0, T + S)
    path.taken(T + S)  # 5 mm at 1 mm/s: it ends near 6.0 s
    assert second(path, 8.0, 10.0, 20.0, -24.0) is None
    assert "too late" in second(path, 11.0, 10.0, 20.0, -24.0).given
    assert second(path, 20.0, *LOW) is None


def test_moves_that_wait_for_others_begin_when_those_have_ended(path):
    path.move(LOW, 1.0, T + S)
    path.taken(T + S)
    path.move(HIGH, 0.5, T + round(1.1 * S))
    path.taken(T + round(1.1 * S))  # at once, as the queue has room: it ends near 16.1 s
    assert second(path, 17.0, 10.0, 20.0, -21.0) is None
    assert second(path, 20.0, 10.0, 20.0, -20.5) is None
    assert "too late" in second(path, 26.0, 10.0, 20.0, -20.5).given
    path.rested(T + 27 * S)
    assert second(path, 40.0, *HIGH) is None


def test_a_place_that_cannot_have_been_reached_is_none(path):
    assert second(path, 1.0, *HIGH) is None
    assert path.out_of_reach(LOW, T + 2 * S) == ""
    assert "farther than it can have moved" in path.out_of_reach((-300.0, 0.0, 0.0), T + 2 * S)


@pytest.mark.parametrize(("z", "words"), [(-20.0, "dropped the move"), (-25.0, None)])
def test_a_pause_passes_where_the_move_before_it_ends(path, z, words):
    path.move(LOW, 5.0, T + S)
    path.taken(T + S)
    for seconds in (2.5, 2.6, 2.7):
        assert path.off(report(seconds, 10.0, 20.0, z)) is None
    fault = path.rested(T + round(2.8 * S), pause=0.6)
    assert (fault is None) if words is None else words in fault.given


def test_one_damaged_report_of_a_pause_accuses_no_move(path):
    path.move(LOW, 5.0, T + S)
    path.off(report(2.6, *LOW))
    path.off(report(2.7, 10.0, 20.0, -22.0))
    assert path.rested(T + round(2.8 * S), pause=0.6) is None


def test_reports_of_the_way_accuse_no_pause_after_it(path):
    path.move(LOW, 5.0, T + S)
    for seconds, z in ((1.9, -23.0), (2.0, -23.5)):
        path.off(report(seconds, 10.0, 20.0, z))
    assert path.rested(T + round(2.8 * S), pause=0.6) is None
    assert path.rested(T + round(2.8 * S)) is None
