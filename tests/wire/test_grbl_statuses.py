"""The times that bracket a reported position."""

import numpy as np
import pytest

from tacdata.clock import Clock
from tacdata.host import Host
from tacdata.wire.grbl import statuses as grbl_statuses
from tacdata.wire.grbl.lines import parse_status
from tacdata.wire.grbl.statuses import REPORT_LAG_NS, Statuses

MACHINE = parse_status("<Run|MPos:1,2,3|FS:60,0>")
WORK = parse_status("<Run|WPos:1,2,3|FS:60,0>")


@pytest.fixture
def statuses():
    return Statuses(Clock.start())


def test_one_query_at_a_time(statuses):
    assert statuses.ask()
    assert not statuses.ask()
    asked = statuses.asked_ns
    status = statuses.take(MACHINE, asked + 7)
    assert (status.sent_ns, status.arrival_ns) == (asked, asked + 7)
    assert statuses.ask()


def test_an_answer_after_a_repeated_query_may_be_the_first_ones_or_the_seconds(statuses, monkeypatch):
    monkeypatch.setattr(grbl_statuses, "REPEAT", 0.0)
    assert statuses.ask()
    first = statuses.asked_ns
    assert statuses.ask(), "repeated"
    assert statuses.take(MACHINE, first + 10_000_000).sent_ns == first
    repeated = statuses.asked_ns
    assert repeated is not None, "the second query may still be answered"
    assert statuses.take(MACHINE, first + 20_000_000).sent_ns == repeated


class ByHand(Host):
    """A computer whose monotonic time is set by hand."""

    shown = 100.0

    def monotonic(self):
        return self.shown


def test_queries_that_were_answered_together_do_not_slow_down_what_follows():
    host = ByHand()
    statuses = Statuses(Clock.start(host=host))
    assert statuses.ask()
    first = statuses.asked_ns
    for _ in range(3):
        host.shown += 0.6
        assert statuses.ask(), "repeated, as the host or the controller stalls"
    assert statuses.take(MACHINE, first + 2_000_000_000).sent_ns == first
    host.shown += 0.3
    assert not statuses.ask(), "another answer may still come"
    host.shown += 0.3
    assert statuses.ask(), "none came: all were answered by one report"
    for _ in range(5):
        asked = statuses.asked_ns
        host.shown += 0.01
        assert statuses.take(MACHINE, asked + 10_000_000).sent_ns == asked
        host.shown += 0.1
        assert statuses.ask(), "every answer is followed by a query again"


def test_a_report_that_nobody_asked_for_is_younger_than_the_one_before(statuses):
    statuses.automatic = True
    statuses.take(MACHINE, 1_000_000_000)
    assert statuses.take(MACHINE, 1_100_000_000).sent_ns == 1_000_000_000 - REPORT_LAG_NS


def test_work_positions_need_their_offset(statuses):
    assert statuses.take(WORK, 1) is None
    statuses.offset = np.array([10.0, 0.0, -1.0])
    np.testing.assert_array_equal(statuses.take(WORK, 2).position, [11, 2, 2])
    assert len(statuses.collect()) == 1
    assert statuses.collect() == []


def test_inches(statuses):
    statuses.unit = 25.4
    status = statuses.take(parse_status("<Run|MPos:1,0,0|FS:2,0|WCO:0,0,0>"), 1)
    assert status.position[0] == pytest.approx(25.4)
    assert status.feed == pytest.approx(50.8)


def test_a_report_that_cannot_be_read_answered_its_query(statuses):
    assert statuses.ask()
    statuses.spoilt()
    assert statuses.asked_ns is None
    assert statuses.ask()


def test_an_offset_that_reports_never_tell_is_not_known_after_a_reset(statuses):
    statuses.place(np.array([1.0, 1.0, 1.0]))
    np.testing.assert_array_equal(statuses.take(WORK, 0).position, [2, 3, 4])
    statuses.forget()
    assert statuses.unplaced
    assert statuses.take(WORK, 0) is None
    statuses.take(parse_status("<Run|WPos:1,2,3|WCO:5,5,5>"), 0)
    statuses.forget()
    statuses.place(np.zeros(3))
    np.testing.assert_array_equal(statuses.take(WORK, 0).position, [6, 7, 8])
