"""Proposals by the shape of columns over time, and a trial run that states its figures and its faults."""

import numpy as np
import openpyxl
import pytest
from test_proposals import imported, proposed, written

from tacdata.importing.mapping import Mapping
from tacdata.importing.proposing.trial_run import tried

RATE = 50.0
STROKE = np.interp(np.arange(0, 5.4, 1 / RATE), [0, 1, 2.2, 3.2, 4.4, 5.4], [0, 0, 1.2, 1.2, 0, 0])
DEPTH = np.tile(STROKE, 3)
T = np.arange(len(DEPTH)) / RATE
RNG = np.random.default_rng(5)
C0, C1 = (10 + gain * DEPTH + RNG.normal(0, 0.002, len(T)) for gain in (1.0, 0.6))
N = len(T)


def _made(folder):
    """Return a folder for the session that is no part of the source."""
    made = folder.with_name(f"{folder.name}_made")
    made.mkdir()
    return made


def rounded(*columns):
    return [[f"{value:.6f}" for value in column] for column in columns]


def trial(source, header, *columns, name="run_1.csv"):
    written(source / name, header, *rounded(*columns))
    return proposed(source)[0]


def test_settings_flags_counters_and_constants_are_no_channels_and_are_listed(tmp_path):
    header = "time (s),depth (mm),C1,C2,SetTorque,TorqueLimit,FaultFlag,row,half,offset_k"
    columns = (np.full(N, 2.5), np.full(N, 9.0), T > 9, np.arange(N), DEPTH > 0, np.full(N, 3.0))
    found = trial(tmp_path, header, T, DEPTH, C0, C1, *columns)
    assert found.document["taxels"]["columns"] == ["C1", "C2"]
    (listed,) = [question for question in found.questions if "no channels but" in question]
    assert all(name in listed for name in ("SetTorque", "TorqueLimit", "FaultFlag", "row", "half", "offset_k"))


def test_a_dead_channel_among_channels_stays(tmp_path):
    found = trial(tmp_path, "time (s),depth (mm),cap1,cap2,cap3", T, DEPTH, C0, np.full(N, 4.0), C1)
    assert found.document["taxels"]["columns"] == ["cap1", "cap2", "cap3"]


@pytest.mark.parametrize(
    ("time", "position"),
    (
        ("header_stamp", "set_point"),
        ("ros_stamp", "pz_meas"),
        ("time", "dist"),
        ("tiempo", "desplazamiento"),
        ("A", "B"),
        ("t", "motor"),
    ),
)
def test_time_and_position_are_found_by_name_or_shape(tmp_path, time, position):
    names = ("C", "D") if time == "A" else ("cap1", "cap2")
    found = trial(tmp_path, ",".join((time, position, *names)), T, DEPTH, C0, C1)
    (entry,) = found.document["files"].values()
    assert entry["time"]["column"] == time
    assert found.document["position"]["depth"]["column"] == position
    assert found.document["taxels"]["columns"] == list(names)
    assert len(imported(tmp_path, found.document, _made(tmp_path))) == 3


def test_a_reading_as_smooth_as_the_others_is_no_position(tmp_path):
    found = trial(tmp_path, "time,cap1,cap2,cap3", T, C0, C1, C0 + C1)
    assert "position" not in found.document


def test_a_translation_in_metres_is_a_height_and_an_orientation_is_no_channel(tmp_path):
    header = "rx_stamp,translation_x,translation_y,translation_z,rotation_w,cap1,cap2"
    zeros = np.zeros(N)
    found = trial(tmp_path, header, T, zeros + 0.1, zeros + 0.2, 0.3 - DEPTH / 1000, zeros + 1, C0, C1)
    assert found.document["position"]["z"] == {"column": "translation_z", "unit": "m"}
    assert found.document["taxels"]["columns"] == ["cap1", "cap2"]


def test_a_set_point_and_its_error_give_the_measured_depth(tmp_path):
    error = 0.05 * np.sin(T)
    found = trial(tmp_path, "t (s),set_point (mm),position_error (mm),cap1", T, DEPTH + error, error, C0)
    assert found.document["position"]["depth"] == {"expression": "`set_point (mm)` - `position_error (mm)`"}
    presses = imported(tmp_path, found.document, _made(tmp_path))
    assert [press.press.depth for press in presses] == pytest.approx([1.2] * 3, abs=1e-4)


def test_each_stream_has_the_clock_before_it(tmp_path):
    found = trial(tmp_path, "board_time (s),cap1,cap2,stage_time (s),depth (mm)", T + 0.5, C0, C1, T, DEPTH)
    assert found.document["taxels"]["time"]["column"] == "board_time (s)"
    assert found.document["position"]["time"]["column"] == "stage_time (s)"
    first = imported(tmp_path, found.document, _made(tmp_path))[0]
    read = first.taxels.sample_ns[np.argmax(first.taxels.counts[:, 0] > 11.19)]
    deepest = read - first.tip_ns[np.argmax(first.tip[:, 2] > 1.19)]
    assert deepest / 1e9 == pytest.approx(0.5, abs=2 / RATE)


def test_tables_of_results_and_files_without_a_role_are_left_out(tmp_path):
    header = "specimen_no,elastic_modulus,r_squared,thickness (mm)"
    written(tmp_path / "results.csv", header, range(8), *RNG.uniform(1, 2, (3, 8)))
    written(tmp_path / "notes.csv", "when,what", T, T**2)
    found = trial(tmp_path, "time (s),depth (mm),C1,C2", T, DEPTH, C0, C1)
    assert [entry["path"] for entry in found.document["files"].values()] == ["run_1.csv"]
    assert any("results.csv: 8 rows without a time" in question for question in found.questions)
    assert any("notes.csv is not used" in question for question in found.questions)


def test_two_boards_of_one_clock_are_one_skin(tmp_path):
    for run in (0, 1):
        for board, columns in (("left", (C0, C1)), ("right", (C1, 2 * C0))):
            written(tmp_path / f"run{run}_{board}.csv", "time (s),ch1,ch2", *rounded(T, *columns))
        written(tmp_path / f"run{run}_stage.csv", "time (s),depth (mm)", *rounded(T, DEPTH))
    found, _ = proposed(tmp_path)
    assert "8 channels" not in tried(tmp_path, found.mapping)
    assert "4 channels, all answer" in tried(tmp_path, found.mapping)
    first = imported(tmp_path, found.document, _made(tmp_path))[0]
    names = ["run_left ch1", "run_left ch2", "run_right ch1", "run_right ch2"]
    assert found.document["taxels"]["columns"] == names
    assert np.ptp(first.taxels.counts, axis=0) == pytest.approx([1.2, 0.72, 0.72, 2.4], abs=0.03)


def test_boards_of_two_clocks_are_not_put_side_by_side(tmp_path):
    for board, clock in (("left", T), ("right", T + 0.3)):
        written(tmp_path / f"{board}.csv", "time (s),ch1,ch2", *rounded(clock, C0, C1))
    written(tmp_path / "stage.csv", "time (s),depth (mm)", *rounded(T, DEPTH))
    found, _ = proposed(tmp_path)
    assert any("right.csv is not used" in question for question in found.questions)
    files = found.document["files"] | {"left": {"path": ["left.csv", "right.csv"], "join": "columns"}}
    files["left"]["time"] = {"column": "time (s)"}
    assert "other times; give the second one a file of its own" in tried(
        tmp_path, Mapping.from_document({**found.document, "files": files}, tmp_path)
    )


@pytest.mark.parametrize(("ramp", "hold"), (("ramp", "hold"), ("load", "unload"), ("b", "a")))
@pytest.mark.parametrize("restarts", (True, False))
def test_ramp_and_hold_in_two_files_are_one_trial(tmp_path, ramp, hold, restarts):
    time, middle = np.arange(len(STROKE)) / RATE, int(np.argmax(STROKE >= 1.199))
    for run in (0, 1):
        signal = 10 + STROKE + RNG.normal(0, 0.002, len(STROKE))
        for name, rows in ((ramp, slice(0, middle)), (hold, slice(middle, None))):
            begin = time[rows][0] if restarts else 0.0
            columns = rounded(time[rows] - begin, STROKE[rows], signal[rows])
            written(tmp_path / f"trial{run}_{name}.csv", "Time (s),Displacement (mm),C1 (pF)", *columns)
    found, _ = proposed(tmp_path)
    (entry,) = found.document["files"].values()
    assert entry["path"] == [f"trial{{part0}}_{ramp}.csv", f"trial{{part0}}_{hold}.csv"]
    assert entry["join"] == ("continued" if restarts else "rows")
    presses = imported(tmp_path, found.document, _made(tmp_path))
    assert len(presses) == 2
    for press in presses:
        assert press.press.depth == pytest.approx(1.2)
        assert (press.taxels.sample_ns - press.taxels.sample_ns[0]) / 1e9 == pytest.approx(time, abs=1e-6)


def test_ramp_and_hold_in_two_sheets_are_one_trial(tmp_path):
    book, middle = openpyxl.Workbook(), int(np.argmax(STROKE >= 1.199))
    for title, rows in (("Ramp", slice(0, middle)), ("Hold", slice(middle, None))):
        sheet = book.create_sheet(title)
        sheet.append(["Time (s)", "Displacement (mm)", "C1 (pF)"])
        for number, depth in enumerate(STROKE[rows].tolist()):
            sheet.append([number / RATE, depth, 10 + depth])
    del book["Sheet"]
    book.save(tmp_path / "test.xlsx")
    found, _ = proposed(tmp_path)
    (entry,) = found.document["files"].values()
    assert (entry["table"], entry["join"]) == (["Ramp", "Hold"], "continued")
    assert len(imported(tmp_path, found.document, _made(tmp_path))) == 1


def test_an_incomplete_trial_of_parts_is_refused_by_name(tmp_path):
    for name in ("run1_a.csv", "run1_b.csv", "run2_a.csv"):
        written(tmp_path / name, "t,depth,c", *rounded(T, DEPTH, C0))
    files = {"run": {"path": ["run{n}_a.csv", "run{n}_b.csv"], "join": "rows", "time": {"column": "t", "unit": "s"}}}
    mapping = {"name": "x", "files": files, "sensor": {"name": "x"}, "taxels": {"file": "run", "columns": ["c"]}}
    mapping["position"] = {"file": "run", "depth": {"column": "depth", "unit": "mm"}}
    assert "1 files run{n}_a.csv and run{n}_b.csv for {'n': '2'}" in tried(
        tmp_path, Mapping.from_document(mapping, tmp_path)
    )


@pytest.mark.parametrize(
    ("columns", "fault"),
    (
        ((np.concatenate([T[: N // 2], T[: N - N // 2]]), DEPTH, C0), "time goes back by"),
        ((T, DEPTH, RNG.normal(5, 0.01, N)), "no channel answers to any press"),
        ((np.full(N, 7.0), DEPTH, C0), "have one time"),
        ((T, DEPTH - 3.0, C0), "never reaches depth 0"),
    ),
)
def test_a_proposal_with_a_fault_is_not_called_good(tmp_path, columns, fault):
    written(tmp_path / "run.csv", "t,depth,cap", *rounded(*columns))
    mapping = {
        "name": "x",
        "files": {"run": {"path": "run.csv", "time": {"column": "t", "unit": "s"}}},
        "sensor": {"name": "x"},
        "taxels": {"file": "run", "columns": ["cap"]},
        "position": {"file": "run", "depth": {"column": "depth", "unit": "mm"}},
    }
    text = tried(tmp_path, Mapping.from_document(mapping, tmp_path))
    assert "not good as it stands: " in text
    assert fault in text


def test_files_of_another_zero_each_are_not_called_good(tmp_path):
    for run, zero in enumerate((0.3, -4.2, 11.7)):
        written(tmp_path / f"run{run}.csv", "t (s),z (mm),C1,C2", *rounded(T, zero - DEPTH, C0, C1))
    found, _ = proposed(tmp_path)
    text = tried(tmp_path, found.mapping)
    assert "3 of 3 sets of files" in text
    assert "lie 15.9 mm apart" in text
    assert "zero: highest under z" in text
    own = {**found.document["position"], "z": {**found.document["position"]["z"], "zero": "highest"}}
    good = tried(tmp_path, Mapping.from_document({**found.document, "position": own}, tmp_path))
    assert "not good" not in good
    assert "pressed 1.2 mm deep" in good


def test_trials_side_by_side_in_an_array_share_their_clock(tmp_path):
    from scipy.io import savemat

    time = np.arange(len(STROKE)) / RATE
    signals = [10 + STROKE + RNG.normal(0, 0.002, len(STROKE)) for _ in range(2)]
    savemat(tmp_path / "m.mat", {"data": np.stack([np.column_stack([time, STROKE, s]) for s in signals], axis=2)})
    found, _ = proposed(tmp_path)
    (entry,) = found.document["files"].values()
    assert entry["trial_axis"] == 2
    assert found.document["trials"] == {"column": "trial"}
    presses = imported(tmp_path, found.document, _made(tmp_path))
    assert [press.press.depth for press in presses] == pytest.approx([1.2, 1.2])
    assert all(press.taxels.counts.shape[1] == 1 for press in presses)


@pytest.mark.parametrize(
    ("encoding", "names"),
    (
        ("shift_jis", "時間 (s),変位 (mm),静電容量 (pF)"),
        ("gb18030", "时间 (s),位移 (mm),电容 (pF)"),
        ("big5", "時間 (s),位移 (mm),電容 (pF)"),
        ("euc_kr", "시간 (s),변위 (mm),정전용량 (pF)"),
        ("cp1251", "Время (s),Перемещение (mm),Сила (N)"),
        ("cp1252", "Zeit (s),Weg (µm),Kapazität (pF)"),
        ("latin-1", "Zeit (s),Dépôt à côté (mm),é (pF)"),
    ),
)
def test_names_in_older_encodings_are_read(tmp_path, encoding, names):
    from tacdata.importing.formats.source_format import read_table

    lines = [names, *(",".join(row) for row in zip(*rounded(T, DEPTH, C0), strict=True))]
    (tmp_path / "run.csv").write_bytes("\n".join(lines).encode(encoding))
    table = read_table(tmp_path / "run.csv")
    assert list(table.columns) == names.split(",")
    assert any("not UTF-8, read as" in note for note in table.notes)
