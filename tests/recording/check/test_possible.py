"""What cannot be is unusable, with its reason; what a recording cannot tell is said not to be assessed."""

from types import SimpleNamespace

import numpy as np
import pytest
from recording_examples import T0, Press

from tacdata.recording.check.possible import _force, _motion, _times
from tacdata.recording.check.report import check
from tacdata.recording.episode import MeasuredStream


def said(press, tmp_path):
    report = check(press.write(tmp_path / "episode-000000.mcap"))
    return report.usable, "\n".join(f.text for f in report.findings), report.text


def retime(press, time_ns):
    press.counter[:] = -1
    press.sample = press.arrival = np.asarray(time_ns, np.int64)
    return press


def test_rows_of_two_moments_are_unusable(tmp_path):
    press = Press()
    usable, text, _ = said(retime(press, T0 + 10**9 * (np.arange(len(press.sample)) % 2)), tmp_path)
    assert not usable
    assert "rows come before the row ahead of them" in text or "have only 2 different times" in text


def test_a_rate_of_megahertz_is_unusable(tmp_path):
    press = Press()
    usable, text, _ = said(retime(press, T0 + 588 * np.arange(len(press.sample))), tmp_path)
    assert not usable
    assert "1.7e+06 rows a second" in text


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (np.arange(600) / 30, None),
        (np.floor(np.arange(2000) / 3) / 100, "rows have the time of another row"),
        (np.sort(np.arange(600) % 2), "only 2 different times"),
        (np.arange(600) % 2, "their times alternate"),
        (np.arange(600) * 30.0, "rows a second"),
        (np.arange(50) / 1000, "it lasts 0.049 s"),
    ],
)
def test_times(seconds, words):
    found = _times(T0 + np.rint(np.asarray(seconds, float) * 1e9).astype(np.int64))
    assert (found == []) if words is None else words in found[0][2]


def test_a_guide_that_moves_faster_than_commanded_is_unusable(tmp_path):
    press = Press()
    at = len(press.statuses) // 2
    moved = np.add(press.statuses[at].position, [0.0, 30.0, 0.0])
    press.statuses[at] = SimpleNamespace(**{**vars(press.statuses[at]), "position": moved})
    usable, text, _ = said(press, tmp_path)
    assert not usable
    assert "mm/s was commanded" in text


def test_a_path_in_another_unit_is_unusable():
    seconds = np.arange(100)
    tip = np.stack([np.zeros(100), np.zeros(100), 500.0 * (seconds % 2)], axis=1)
    episode = SimpleNamespace(cnc=SimpleNamespace(sample_ns=[]), tip_ns=(seconds * 1e8).astype(np.int64), tip=tip)
    assert "in another unit" in _motion(SimpleNamespace(moves=(), episode=episode))[0][2]


@pytest.mark.parametrize(("newton", "depth", "found"), [(0.0, 0.5, 1), (3.0, 0.5, 1), (0.0, 0.1, 0)])
def test_a_force_that_does_not_notice_the_press_is_unusable(newton, depth, found):
    force = MeasuredStream("force", "N", ("fz",), np.arange(50), np.full((50, 1), newton))
    episode = SimpleNamespace(tip=np.array([[0, 0, -1.0], [0, 0, depth]]), measured=(force,))
    assert len(_force(episode)) == found
    force.values[20] += 0.2
    assert _force(episode) == []


class Late(Press):
    """The controller starts each move after the approach 150 ms late."""

    late = 150_000_000

    def _carry_out(self, bench):
        super()._carry_out(bench)
        self.path = [(start + self.late * (k >= 2), move) for k, (start, move) in enumerate(self.path)]


class InTime(Late):
    late = 0


@pytest.mark.parametrize("kind", [Late, InTime])
def test_a_step_at_rest_is_no_taxels_fault_where_the_controller_came_late(tmp_path, kind):
    press = kind()
    hold = next(c for c in press.commands if c.phase == "hold")
    press.counts[press.sample > hold.acknowledged_ns - 250_000_000, 3:8] += 900
    _, text, _ = said(press, tmp_path)
    assert ("channel 3 jumps by +9" in text) == (kind is InTime)
    assert ("NOT ASSESSED: the controller moved up to 1" in text) == (kind is Late)
    assert ("contradict the commanded profile" in text) == (kind is Late)


def test_what_cannot_be_told_is_not_called_right(tmp_path):
    press = Press()
    press.counts[:] = 9000.0
    press.commands = [c for c in press.commands if c.phase not in ("rest", "approach", "")]
    _, _, page = said(press, tmp_path)
    assert "NOT ASSESSED  whether the readings answer contact: 1 of 1 presses" in page
    (tmp_path / "clean").mkdir()
    assert "NOT ASSESSED" not in said(Press(), tmp_path / "clean")[2]
