"""A position or a reading that repeats an old value is no measurement; a rest, a stair and a quiet channel are."""

import numpy as np
import pytest
from sources import mapping, table, write

from tacdata.importing.imported_session import import_session
from tacdata.recording import read_session
from tacdata.recording.check.report import check
from tacdata.recording.files.reader import read_episode

CUT = {"trials": {"press_above": 0.3}}


def imported(folder, rows, **changes):
    path = write(folder, "csv", rows)
    made = import_session(folder, mapping(folder, path, **{**CUT, **changes}), folder / "session")
    return made, [read_episode(file) for file in read_session(made.folder).episodes]


def held(values, every, late=0):
    """Values as of the last of every so many rows."""
    return np.concatenate([values[:late], np.repeat(values[late::every], every)])[: len(values)]


@pytest.mark.parametrize(("every", "late"), [(10, 0), (4, 3), (6, 2)])
def test_a_position_that_is_updated_slowly_is_taken_at_its_updates(tmp_path, every, late):
    rows = table(presses=3)
    slow = rows.copy()
    slow[:, 1] = held(rows[:, 1], every, late)
    made, episodes = imported(tmp_path, slow)
    assert [round(e.press.depth, 2) for e in episodes] == [1.2, 1.2, 1.2]
    assert any(f"a new value comes every {every / 20:.3g} s only" in note for note in made.notes)
    assert f"every {every / 20:.3g} s only" in check(made.folder).text
    depth = np.concatenate([np.interp(e.taxels.sample_ns, e.tip_ns, e.tip[:, 2]) for e in episodes])
    stale = np.abs(slow[:, 1] - rows[:, 1]).max()
    assert np.abs(depth - rows[: len(depth), 1]).max() < 0.55 * stale


@pytest.mark.parametrize(("rate", "step"), [(20.0, 0.05), (50.0, 0.1)])
def test_a_coarse_position_in_a_slow_motion_costs_no_reading(tmp_path, rate, step):
    time = np.arange(0, 120, 1 / rate)
    path = np.interp(time, [0, 5, 29, 40, 64, 120], [0, 0, 1.2, 1.2, 0, 0])
    noise = np.random.default_rng(0).normal(0, 0.002, (len(time), 2))
    rows = np.column_stack([time, np.floor(path / step + 1e-9) * step, 10 + path[:, None] * [1.0, 0.6] + noise])
    made, (episode,) = imported(tmp_path, rows)
    assert len(episode.taxels.counts) == len(rows) and any("a new value comes every" in note for note in made.notes)
    depth = np.interp(episode.taxels.sample_ns, episode.tip_ns, episode.tip[:, 2])
    assert np.abs(depth - path).max() < 1.05 * step and np.abs(depth - path).mean() < 0.3 * step


def test_a_slow_position_is_kept_where_it_is_trusted(tmp_path):
    rows = table(presses=3)
    rows[:, 1] = held(rows[:, 1], 10)
    position = {"file": "run", "depth": {"column": "depth", "unit": "mm"}, "trusted": True}
    made, _ = imported(tmp_path, rows, position=position)
    assert not any("old values" in note for note in made.notes)


@pytest.mark.parametrize("seconds", (0.3, 0.45, 0.6))
def test_a_last_value_that_repeats_in_a_motion_is_left_out(tmp_path, seconds):
    rows = table(presses=3)
    lost = 0
    for begin in (1.3, 6.2, 13.3):
        stays = np.flatnonzero((rows[:, 0] >= begin) & (rows[:, 0] < begin + seconds))
        rows[stays, 1] = rows[stays[0], 1]
        lost += len(stays) - 1
    made, episodes = imported(tmp_path, rows)
    assert len(episodes) == 3
    assert any(f"its last value repeats while the readings go on: {lost} old values" in note for note in made.notes)


@pytest.mark.parametrize("level", (0.0, 0.3, 0.7))
def test_a_stuck_encoder_gives_no_depth(tmp_path, level):
    rows = table(presses=3)
    second = (rows[:, 0] > 5.2) & (rows[:, 0] < 9.9)
    rows[:, 1] = np.where(second, np.minimum(rows[:, 1], level), rows[:, 1])
    made, episodes = imported(tmp_path, rows)
    assert any("it stands still while the readings rise and fall, in 1 stretches" in note for note in made.notes)
    assert "stands still while the readings rise and fall" in check(made.folder).text
    for episode in episodes:
        depth = np.interp(episode.taxels.sample_ns, episode.tip_ns, episode.tip[:, 2])
        answer = episode.taxels.counts[:, 0] - 10
        assert np.abs(answer - depth).max() < 0.1


def lagging(path, seconds):
    """A path as a slow sensor reads it."""
    result = np.zeros(len(path))
    for row in range(1, len(path)):
        result[row] = result[row - 1] + (path[row] - result[row - 1]) * (1 - np.exp(-0.05 / seconds))
    return result


def relaxing(path, seconds):
    """A path as a skin answers it whose stress relaxes by half."""
    fast = np.zeros(len(path))
    for row in range(1, len(path)):
        fast[row] = (fast[row - 1] + path[row] - path[row - 1]) * np.exp(-0.05 / seconds)
    return 0.5 * path + 0.5 * fast


@pytest.mark.parametrize(
    ("name", "every", "answer"),
    [
        ("stairs of the machine, and a skin that follows soon", 10, lambda path: lagging(path, 0.1)),
        ("stairs of the machine, and a skin that relaxes", 20, lambda path: relaxing(path, 1.0)),
        ("holds in which a skin relaxes", 1, lambda path: relaxing(path, 0.8)),
        ("holds in which a foam follows slowly", 1, lambda path: lagging(path, 1.0)),
        ("holds with an alternating sign", 1, lambda path: (1 + path) * (-1.0) ** np.arange(len(path))),
    ],
)
def test_a_real_rest_stays(tmp_path, name, every, answer):
    rows = table(presses=3)
    rows[:, 1] = held(rows[:, 1], every)
    noise = np.random.default_rng(3).normal(0, 0.002, (len(rows), 2))
    rows[:, 2:] = 10 + answer(rows[:, 1])[:, None] * [1.0, 0.6] + noise
    made, episodes = imported(tmp_path, rows)
    assert sum(len(e.taxels.counts) for e in episodes) == len(rows), name
    assert not any("old values" in note or "stands still" in note for note in made.notes), name


def test_a_drives_current_rises_and_falls_at_a_standstill(tmp_path):
    rows = table(presses=4)
    speed = np.gradient(rows[:, 1]) * 20
    standing = np.flatnonzero(rows[:, 1] == 1.2)
    speed[standing] += 0.8 * np.hanning(len(standing) // 4 + 1)[np.arange(len(standing)) % (len(standing) // 4)]
    rows[:, 2:] = 0.1 + speed[:, None] * [1.0, 0.7] + np.random.default_rng(3).normal(0, 0.02, (len(rows), 2))
    made, episodes = imported(tmp_path, rows)
    assert sum(len(e.taxels.counts) for e in episodes) == len(rows)
    assert not any("stands still" in note for note in made.notes)


@pytest.mark.parametrize(("rows_back", "share"), [(4, 0.1), (2, 0.3), (6, 0.5)])
def test_a_hold_before_a_fast_way_back_stays(tmp_path, rows_back, share):
    ramp, hold, back = np.linspace(-9, 1.5, 60), np.full(60, 1.5), np.linspace(1.5, -9, rows_back + 1)[1:]
    path = np.tile(np.concatenate([np.full(30, -9.0), ramp, hold, back, np.full(20, -9.0)]), 4)
    answer = np.maximum(path, 0) * (1 - share) + np.maximum(relaxing(np.maximum(path, 0), 1.5), 0) * share
    noise = np.random.default_rng(3).normal(0, 0.002, (len(path), 2))
    rows = np.column_stack([np.arange(len(path)) * 0.05, path, 10 + answer[:, None] * [1.0, 0.6] + noise])
    made, episodes = imported(tmp_path, rows)
    assert sum(len(e.taxels.counts) for e in episodes) == len(rows)
    assert not any("old values" in note or "stands still" in note for note in made.notes)


@pytest.mark.parametrize(("begin", "end"), [(7.2, 9.4), (11.2, 11.9), (2.05, 4.5)])
def test_readings_that_freeze_are_missing(tmp_path, begin, end):
    rows = table(presses=3)
    stays = np.flatnonzero((rows[:, 0] >= begin) & (rows[:, 0] < end))
    rows[stays, 2] = rows[stays[0], 2]
    made, episodes = imported(tmp_path, rows)
    counts = np.concatenate([e.taxels.counts for e in episodes])
    assert np.isnan(counts[:, 0]).sum() == len(stays) - 1 and np.isfinite(counts[:, 1]).all()
    assert any(f"{len(stays) - 1} readings repeat an old one" in note for note in made.notes)


@pytest.mark.parametrize(
    ("name", "reading"),
    [
        ("counts of a quiet converter", lambda depth: np.rint(520 + 100 * depth)),
        ("a tared force, cut at zero", lambda depth: np.maximum(depth - 0.1, 0.0)),
        ("a channel that saturates", lambda depth: np.minimum(depth, 0.9)),
        ("a noisy one that saturates", lambda depth: np.minimum(depth + 1e-3 * np.sin(np.arange(len(depth))), 0.9)),
        ("a noisy one that is cut below", lambda depth: np.maximum(depth + 1e-3 * np.sin(np.arange(len(depth))), 0.4)),
    ],
)
def test_a_quiet_channel_stays(tmp_path, name, reading):
    rows = table(presses=3)
    rows[:, 2] = reading(rows[:, 1])
    made, episodes = imported(tmp_path, rows)
    assert not any("repeat an old one" in note for note in made.notes), name
    assert all(np.isfinite(e.taxels.counts).all() for e in episodes)


def test_readings_of_a_slow_sensor_in_a_fast_table_are_told(tmp_path):
    rows = table(presses=3)
    rows[:, 2:] = np.repeat(rows[::5, 2:], 5, axis=0)[: len(rows)]
    made, _ = imported(tmp_path, rows)
    assert "taxels: the readings change every 5 rows only; the rows in between repeat them" in made.notes
