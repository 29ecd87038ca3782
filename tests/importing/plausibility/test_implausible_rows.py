"""Dropouts, gaps, codes, rails, cut numbers and units that contradict each other: found, counted, never counted in."""

import numpy as np
import pytest
from sources import FORMS, mapping, table, write

from tacdata.chain.at_rest import below_zero, zero_side
from tacdata.errors import FormatError
from tacdata.importing.imported_session import import_session
from tacdata.recording import read_session
from tacdata.recording.check.report import check
from tacdata.recording.files.reader import read_episode

CUT = {"trials": {"press_above": 0.3}}


def imported(folder, path, **changes):
    """Return the import and its recordings."""
    made = import_session(folder, mapping(folder, path, **changes), folder / "session")
    return made, [read_episode(file) for file in read_session(made.folder).episodes]


@pytest.mark.parametrize("form", FORMS)
def test_one_read_of_zero_in_each_hold_cuts_no_press_in_two(tmp_path, form):
    rows = table(presses=3)
    holds = np.flatnonzero(rows[:, 1] == 1.2)
    dropped = [int(part[len(part) // 2]) for part in np.split(holds, np.flatnonzero(np.diff(holds) > 1) + 1)]
    rows[dropped, 1] = 0.0
    made, episodes = imported(tmp_path, write(tmp_path, form, rows), **CUT)
    assert [round(e.press.depth, 3) for e in episodes] == [1.2, 1.2, 1.2]
    assert any("3 rows jump faster than the machine moves elsewhere" in note for note in made.notes)
    assert "3 rows jump" in check(made.folder).text


def test_a_dropout_can_be_overruled(tmp_path):
    rows = table(presses=1)
    rows[50, 1] = 0.0
    position = {"file": "run", "depth": {"column": "depth", "unit": "mm"}, "trusted": True}
    _, episodes = imported(tmp_path, write(tmp_path, "csv", rows), position=position, **CUT)
    assert len(episodes) == 2


def test_a_dropout_of_a_second_is_one_where_the_readings_stay(tmp_path):
    rows = table(presses=3)
    holds = np.flatnonzero(rows[:, 1] == 1.2)
    rows[holds[3:15], 1] = 0.0
    made, episodes = imported(tmp_path, write(tmp_path, "csv", rows), **CUT)
    assert len(episodes) == 3 and any("12 rows jump" in note for note in made.notes)


def test_taps_that_the_readings_follow_are_no_dropouts(tmp_path):
    rows = table(presses=2)
    for row in (10, 14, 110, 114):
        rows[row, 1] = 1.0
        rows[row, 2:] += [1.0, 0.6]
    made, episodes = imported(tmp_path, write(tmp_path, "csv", rows), **CUT)
    assert len(episodes) == 6 and not any("dropouts" in note for note in made.notes)


def test_a_set_point_that_jumps_is_no_fault(tmp_path):
    rows = table(presses=3)
    rows[:, 1] = np.where(rows[:, 1] > 0.6, 1.2, 0.0)
    made, episodes = imported(tmp_path, write(tmp_path, "csv", rows), **CUT)
    assert len(episodes) == 3 and not any("jump" in note for note in made.notes)


def test_a_first_row_of_zeros_is_no_position(tmp_path):
    rows = table(presses=1)
    rows[:, 1] -= 20.0
    rows[0, 1] = 0.0
    made, (episode,) = imported(tmp_path, write(tmp_path, "csv", rows))
    assert episode.tip[:, 2].max() == pytest.approx(-18.8, abs=1e-3)
    assert any("1 rows jump" in note for note in made.notes)


def two_files(folder, keep):
    """Write the channels and a position of which some rows are kept."""
    rows = table(presses=3)
    write(folder, "csv", rows)
    (folder / "run.csv").rename(folder / "adc.csv")
    write(folder, "csv", rows[keep(rows)])
    clock = {"column": "t", "unit": "s", "zero": "shared"}
    return rows, {
        "files": {"run": {"path": "run.csv", "time": clock}, "adc": {"path": "adc.csv", "time": clock}},
        "taxels": {"file": "adc", "columns": ["c0", "c1"], "unit": "pF"},
    }


def test_channels_in_a_gap_of_the_position_have_no_depth_and_are_left_out(tmp_path):
    rows, changes = two_files(tmp_path, lambda rows: ~((rows[:, 0] > 1.4) & (rows[:, 0] < 3.7)))
    made, (episode,) = imported(tmp_path, tmp_path / "run.csv", **changes)
    lost = int(((rows[:, 0] > 1.39) & (rows[:, 0] < 3.69)).sum())
    assert len(episode.taxels.counts) == pytest.approx(len(rows) - lost, abs=2)
    assert any("stops 1 times while the channels run on" in note for note in made.notes)
    assert "stops 1 times" in check(made.folder).text


def test_a_log_that_only_writes_changes_has_no_gap(tmp_path):
    _, changes = two_files(tmp_path, lambda rows: np.abs(np.gradient(rows[:, 1])) > 1e-9)
    made, (episode,) = imported(tmp_path, tmp_path / "run.csv", **changes)
    assert len(episode.taxels.counts) == len(table(presses=3))
    assert not any("stops" in note for note in made.notes)


def test_one_press_that_misses_the_skin_gives_no_advice_on_zero():
    depth = np.interp(np.arange(200), [0, 50, 100, 150, 199], [-9, -9, 1.5, -9, -9])
    answer = np.maximum(depth, 0)[:, None] + np.random.default_rng(0).normal(0, 0.01, (200, 1))
    noise = answer - np.maximum(depth, 0)[:, None]
    assert below_zero([zero_side(depth, answer)] * 11 + [zero_side(depth, noise)]) == 0
    both = np.abs(depth)[:, None]
    assert below_zero([zero_side(depth, both)] * 7 + [zero_side(depth, answer)] * 5) == 9


@pytest.mark.parametrize("code", (9.9e37, 1e30, -1e105, 4.44e49, 1e9))
@pytest.mark.parametrize("unit", (1.0, 1e-12))
def test_overload_codes_are_missing_and_counted(tmp_path, code, unit):
    rows = table()
    rows[:, 2:] *= unit
    rows[[40, 41, 90], 2] = code
    path = write(tmp_path, "npz", rows)
    made, (episode,) = imported(tmp_path, path)
    assert np.isnan(episode.taxels.counts[[40, 41, 90], 0]).all()
    assert np.isnan(episode.taxels.counts).sum() == 3
    assert any(note.startswith("taxels: 3 numbers") for note in made.notes)
    assert "no channel answers" not in check(made.folder).text


@pytest.mark.parametrize("rail", (255, 4095, 65535))
def test_readings_at_the_rail_of_a_converter_are_missing(tmp_path, rail):
    rows = table(seed=1)
    counts = np.rint(rail * (0.3 + 0.68 * rows[:, 1] / 1.2) + 3 * np.arange(len(rows)) % 7)
    rows[:, 2:] = np.minimum(counts, rail)[:, None]
    clipped = rows[:, 1] > 1.1
    rows[clipped, 2] = rail
    made, (episode,) = imported(tmp_path, write(tmp_path, "npz", rows))
    assert np.isnan(episode.taxels.counts[clipped, 0]).all()
    assert any("largest that its converter has" in note for note in made.notes)


def test_whole_readings_far_from_any_rail_and_flags_stay(tmp_path):
    rows = table()
    rows[:, 2] = np.rint(500 + 300 * rows[:, 1])
    rows[:, 3] = np.where(rows[:, 1] > 1, 255, 0)
    _, (episode,) = imported(tmp_path, write(tmp_path, "npz", rows))
    assert np.isfinite(episode.taxels.counts).all()


def test_small_values_of_a_simulation_are_no_background_of_codes(tmp_path):
    rows = table()
    rows[:, 2] = np.maximum(1e-13, rows[:, 1] ** 1.5)
    _, (episode,) = imported(tmp_path, write(tmp_path, "npz", rows))
    assert np.isfinite(episode.taxels.counts).all()


def test_a_number_cut_at_the_end_of_a_file_is_missing(tmp_path):
    path = write(tmp_path, "csv", table())
    path.write_text(path.read_text()[:-5])
    made, (episode,) = imported(tmp_path, path)
    assert np.isnan(episode.taxels.counts[-1, 1]) and np.isnan(episode.taxels.counts).sum() == 1
    assert any("the last number is cut off" in note for note in made.notes)


def test_two_cells_of_text_do_not_take_a_whole_file(tmp_path):
    path = write(tmp_path, "csv", table(presses=4))
    lines = path.read_text().split("\n")
    for row in (30, 200):
        lines[row] = ",".join([*lines[row].split(",")[:-1], "ERR 7"])
    path.write_text("\n".join(lines))
    made, episodes = imported(tmp_path, path, **CUT)
    assert len(episodes) == 4 and any("2 cells of c1 [pF] hold no number" in note for note in made.notes)


def test_the_unit_of_a_type_wins_and_another_in_a_header_is_refused(tmp_path):
    import pyarrow as pa
    from pyarrow import parquet

    rows = table()
    for kind in (pa.duration("us"), pa.duration("ms"), pa.timestamp("us")):
        scale = {"us": 1e6, "ms": 1e3}[kind.unit]
        columns = {"depth": rows[:, 1], "c0": rows[:, 2], "c1": rows[:, 3]}
        times = pa.array(np.rint(rows[:, 0] * scale).astype("int64"), kind)
        folder = tmp_path / str(kind)
        folder.mkdir()
        parquet.write_table(pa.table({"t": times, **columns}), folder / "run.parquet")
        _, (episode,) = imported(folder, folder / "run.parquet")
        np.testing.assert_allclose(np.diff(episode.taxels.sample_ns), 50_000_000, atol=1)
    path = write(tmp_path, "csv", rows)
    files = {"run": {"path": path.name, "time": {"column": "t", "unit": "ms"}}}
    with pytest.raises(FormatError, match=r"states s for t \[s\], and the mapping ms"):
        imported(tmp_path, path, files=files)
    position = {"file": "run", "depth": {"column": "depth", "unit": "um"}}
    with pytest.raises(FormatError, match=r"states mm for depth \[mm\], and the mapping um"):
        imported(tmp_path, path, position=position)


@pytest.mark.filterwarnings("error")
def test_unix_milliseconds_called_seconds_are_refused_without_an_overflow(tmp_path):
    rows = table()
    rows[:, 0] = np.rint(1_795_597_200_000 + 1000 * rows[:, 0])
    for form in ("npz", "jsonl"):
        with pytest.raises(FormatError, match=r"reach 1\.8e") as refused:
            imported(tmp_path, write(tmp_path, form, rows))
        assert "to ms" in refused.value.remedy


def test_a_rate_that_the_file_states_and_does_not_hold_is_unusable(tmp_path):
    path = write(tmp_path, "csv", table())
    path.write_text("Sampling rate: 100 Hz\n" + path.read_text())
    made, _ = imported(tmp_path, path)
    report = check(made.folder)
    assert not report.usable and "20 rows a second, and the source states 100" in report.text
