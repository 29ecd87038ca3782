"""Inside a recording time never goes back: restarts are cut, wraps continued, wrong times set aside."""

from datetime import datetime, timedelta

import numpy as np
import pytest
from sources import FORMS, mapping, table, write

from tacdata.errors import FormatError
from tacdata.importing.imported_session import import_session
from tacdata.importing.plausibility.time_order import time_order
from tacdata.importing.proposing.description import described
from tacdata.importing.proposing.proposal import proposed_mapping
from tacdata.recording import read_session
from tacdata.recording.check.report import check
from tacdata.recording.files.reader import read_episode


def imported(folder, path, **changes):
    """Return the import and its recordings."""
    made = import_session(folder, mapping(folder, path, **changes), folder / "session")
    return made, [read_episode(file) for file in read_session(made.folder).episodes]


def assert_in_order(episode, rows):
    """The rows of the source, in its own order, at its own rate of 20 Hz."""
    time_ns = episode.taxels.sample_ns
    np.testing.assert_allclose(np.diff(time_ns), 50_000_000, atol=1000)
    np.testing.assert_allclose(episode.taxels.counts, rows[:, 2:], atol=1e-6)


@pytest.mark.parametrize("form", FORMS)
def test_a_restart_ends_a_recording_in_every_format(tmp_path, form):
    rows = table()
    rows[60:, 0] -= rows[60, 0]
    made, episodes = imported(tmp_path, write(tmp_path, form, rows))
    assert made.refused == () and [len(e.taxels.counts) for e in episodes] == [60, len(rows) - 60]
    for episode, part in zip(episodes, (rows[:60], rows[60:]), strict=True):
        assert_in_order(episode, part)
    assert any("by 2.95 s in row 61" in note for note in made.notes)


@pytest.mark.parametrize(("bits", "tick", "unit"), [(16, 1e-3, "ms"), (32, 1e-6, "us"), (24, 1e-6, "us")])
def test_the_wrap_of_a_counter_is_continued_and_named(tmp_path, bits, tick, unit):
    rows = table()
    wrapped = rows.copy()
    wrapped[:, 0] = np.rint(rows[:, 0] / tick + 2**bits - 60 * 0.05 / tick) % 2**bits
    path = write(tmp_path, "csv", wrapped)
    files = {"run": {"path": path.name, "time": {"column": "t", "unit": unit}}}
    text = path.read_text().replace("t [s]", "t")
    path.write_text(text)
    made, (episode,) = imported(tmp_path, path, files=files)
    assert_in_order(episode, rows)
    assert any(f"wraps at 2^{bits}" in note and "row 61" in note for note in made.notes)


def test_rows_from_the_latest_to_the_first_are_turned(tmp_path):
    rows = table()
    made, (episode,) = imported(tmp_path, write(tmp_path, "csv", rows[::-1]))
    assert_in_order(episode, rows)
    assert any("its first row is the latest; the rows are turned" in note for note in made.notes)


@pytest.mark.parametrize("behind", (0, 60, 150))
def test_seconds_of_a_week_are_continued(tmp_path, behind):
    rows = table()
    wrapped = rows.copy()
    wrapped[:, 0] = np.round((rows[:, 0] + 604_800 - 0.05 * behind) % 604_800, 3)
    made, (episode,) = imported(tmp_path, write(tmp_path, "csv", wrapped))
    assert_in_order(episode, rows)
    assert any("wraps at the end of a week" in note for note in made.notes) == (behind > 0)


def test_half_days_are_continued_over_noon_and_midnight(tmp_path):
    rows = table()
    moments = [datetime(2026, 1, 1, 23, 59, 55) + timedelta(seconds=t) for t in rows[:, 0].tolist()]
    lines = ["time,depth [mm],c0 [pF],c1 [pF]"]
    for moment, row in zip(moments, rows.tolist(), strict=True):
        lines.append(moment.strftime("%I:%M:%S.%f %p") + "".join(f",{value:.6f}" for value in row[1:]))
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines) + "\n")
    _, (episode,) = imported(tmp_path, path, files={"run": {"path": path.name, "time": {"column": "time"}}})
    assert_in_order(episode, rows)


def counted(folder, rows, numbers):
    """Write rows by a counter in place of a clock; a mapping's files."""
    columns = np.column_stack([numbers, rows[:, 1:]])
    path = write(folder, "csv", columns, ("frame", "depth [mm]", "c0 [pF]", "c1 [pF]"))
    return path, {"run": {"path": path.name, "time": {"column": "frame", "rate": 20.0}}}


@pytest.mark.parametrize("bits", (8, 16))
def test_a_counter_of_rows_is_a_clock_that_wraps(tmp_path, bits):
    rows = table()
    path, files = counted(tmp_path, rows, (np.arange(len(rows)) + 2**bits - 70) % 2**bits)
    made, (episode,) = imported(tmp_path, path, files=files)
    assert_in_order(episode, rows)
    assert any(f"wraps at 2^{bits}" in note and "row 71" in note for note in made.notes)


def test_a_counter_of_rows_shows_lost_rows_and_restarts(tmp_path):
    rows = table()
    kept = np.delete(np.arange(len(rows)), slice(40, 50))
    numbers = np.where(kept < 120, kept, kept - 120)
    path, files = counted(tmp_path, rows[kept], numbers)
    made, (first, second) = imported(tmp_path, path, files=files)
    steps = np.diff(first.taxels.sample_ns) / 1e9
    assert steps.max() == pytest.approx(0.55) and np.median(steps) == pytest.approx(0.05)
    assert len(second.taxels.counts) == len(rows) - 120
    assert any("frame: time goes back by 5.95 s in row 111" in note for note in made.notes)


def test_a_devices_counter_that_begins_again_beside_a_clock_is_told(tmp_path):
    rows = table()
    numbers = np.arange(len(rows))
    numbers[90:] -= 90
    path = write(tmp_path, "csv", np.column_stack([rows, numbers]), ("t [s]", "depth [mm]", "c0 [pF]", "c1 [pF]", "n"))
    taxels = {"file": "run", "columns": ["c0", "c1"], "unit": "pF", "counter": "n"}
    made, _ = imported(tmp_path, path, taxels=taxels)
    assert any("the device's counter begins again" in note for note in made.notes)
    assert "counter begins again" in check(made.folder).text


@pytest.mark.parametrize(("lost", "restart"), [(0, 90), (10, 0), (10, 120)])
def test_a_proposal_takes_a_counter_for_the_clock_where_rows_are_lost(tmp_path, lost, restart):
    rows = table()
    numbers = np.arange(len(rows))
    numbers[restart:] -= restart
    numbers[40:] += lost
    path, _ = counted(tmp_path, rows, numbers)
    found = proposed_mapping(path, described(path)[0]).document
    assert found["files"]["run"]["time"] == {"column": "frame", "rate": 50.0}


def test_a_counter_that_wraps_many_times_is_continued():
    time_ns = np.arange(0, 400_000_000, 1_000_000) % (2**16 * 1000)
    order = time_order(time_ns, "board", tick_ns=1000.0)
    (rows,) = order.stretches
    assert (np.diff(order.time_ns[rows]) > 0).all() and order.time_ns[-1] == 399_000_000


def test_trials_as_long_as_a_minute_or_an_hour_are_no_wrap():
    time_ns = np.tile(np.arange(0, 60_000_000_000, 50_000_000), 3)
    assert len(time_order(time_ns, "board", tick_ns=1e9).stretches) == 3


@pytest.mark.parametrize("form", ("csv", "npz", "parquet"))
def test_times_that_were_never_written_are_set_aside_and_counted(tmp_path, form):
    rows = table()
    rows[40:60, 0] = 0.0
    made, (episode,) = imported(tmp_path, write(tmp_path, form, rows))
    assert len(episode.taxels.counts) == len(rows) - 20
    assert any("20 rows have a time out of line" in note and "row 41" in note for note in made.notes)


def test_a_lost_chunk_of_a_zarr_array_is_missing_and_no_zero(tmp_path):
    path = write(tmp_path, "zarr", table())
    for name in ("t", "c0"):
        (path / name / "c" / "2").unlink()
    made, (episode,) = imported(tmp_path, path)
    assert len(episode.taxels.counts) == len(table()) - 20
    assert (np.diff(episode.taxels.sample_ns) > 0).all()
    assert any("t: 1 of 10 chunks are not there; their values are missing" in note for note in made.notes)


def test_a_few_rows_that_came_late_are_put_in_order_and_counted(tmp_path):
    rows = table()
    swapped = rows.copy()
    swapped[[30, 31]] = rows[[31, 30]]
    made, (episode,) = imported(tmp_path, write(tmp_path, "csv", swapped))
    assert_in_order(episode, rows)
    assert any("1 rows came late" in note for note in made.notes)


def test_cycles_of_several_machines_that_alternate_are_refused_with_row_and_size(tmp_path):
    rows = table()
    mixed = np.stack([rows, rows + np.array([100.02, 0, 0, 0])], axis=1).reshape(-1, 4)
    with pytest.raises(FormatError) as refused:
        imported(tmp_path, write(tmp_path, "csv", mixed))
    assert "in row 3" in refused.value.given and "trials" in refused.value.remedy


def test_cycles_that_a_column_numbers_come_in_by_it(tmp_path):
    rows = table()
    mixed = np.stack([rows, rows + np.array([0.02, 0, 0, 0])], axis=1).reshape(-1, 4)
    mixed = np.column_stack([mixed, np.tile([1.0, 2.0], len(rows))])
    path = write(tmp_path, "csv", mixed, ("t [s]", "depth [mm]", "c0 [pF]", "c1 [pF]", "machine"))
    _, episodes = imported(tmp_path, path, trials={"column": "machine"})
    assert len(episodes) == 2
    for episode in episodes:
        assert_in_order(episode, rows)


def test_one_clock_that_begins_again_beside_another_that_does_not_is_refused(tmp_path):
    rows = table()
    first = write(tmp_path, "csv", rows).rename(tmp_path / "stage.csv")
    restarted = rows.copy()
    restarted[60:, 0] -= restarted[60, 0]
    path = write(tmp_path, "csv", restarted)
    files = {
        "run": {"path": path.name, "time": {"column": "t", "unit": "s", "zero": "shared"}},
        "stage": {"path": first.name, "time": {"column": "t", "unit": "s", "zero": "shared"}},
    }
    position = {"file": "stage", "depth": {"column": "depth", "unit": "mm"}}
    with pytest.raises(FormatError, match=r"taxels by 2.95 s in row 61.*position nowhere"):
        imported(tmp_path, path, files=files, position=position)


def test_a_long_table_is_cut_where_its_channels_begin_again(tmp_path):
    rows = table()
    rows[60:, 0] -= rows[60, 0]
    lines = ["t [s],channel,value,depth [mm]"]
    lines += [f"{t:.4f},c{k},{value[k]:.5f},{d:.5f}" for t, d, *value in rows.tolist() for k in (0, 1)]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines) + "\n")
    _, episodes = imported(
        tmp_path, path, taxels={"file": "run", "long": {"channel": "channel", "value": "value"}, "unit": "pF"}
    )
    assert [len(e.taxels.counts) for e in episodes] == [60, len(rows) - 60]
    np.testing.assert_allclose(episodes[1].taxels.counts, rows[60:, 2:], atol=1e-5)


def test_check_calls_a_loop_bursts_and_another_rate_unusable(tmp_path):
    rows = table()
    (tmp_path / "loop").mkdir()
    loop = np.concatenate([rows, rows])
    loop[:, 0] = np.arange(len(loop)) * 0.05
    made, _ = imported(tmp_path / "loop", write(tmp_path / "loop", "csv", loop))
    report = check(made.folder)
    assert not report.usable and f"rows {len(rows) + 1} to {2 * len(rows)} repeat rows 1 to" in report.text
    (tmp_path / "bursts").mkdir()
    bursts = rows.copy()
    bursts[:, 0] = np.repeat(rows[::3, 0], 3)[: len(rows)] + np.tile([0.0, 0.005, 0.01], len(rows))[: len(rows)]
    made, _ = imported(tmp_path / "bursts", write(tmp_path / "bursts", "csv", bursts))
    report = check(made.folder)
    assert not report.usable and "every 5 ms in the median" in report.text
