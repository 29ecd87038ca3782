"""Files as labs keep them are recognized by names, units and values; what they do not say is asked."""

import json

import numpy as np
import openpyxl
import pytest
import scipy.io

from tacdata import documents
from tacdata.errors import FormatError
from tacdata.importing.formats.source_format import read_table
from tacdata.importing.imported_session import import_session
from tacdata.importing.proposing.description import described
from tacdata.importing.proposing.proposal import proposed_mapping
from tacdata.importing.proposing.trial_run import tried
from tacdata.recording import read_session
from tacdata.recording.files.reader import read_episode

STROKE = np.concatenate([np.zeros(10), np.linspace(0, 1, 20), np.ones(10), np.linspace(1, 0, 20), np.zeros(10)])
"""A press, one row every 0.05 s; as a share of its depth."""
T = 0.05 * np.arange(len(STROKE))


def proposed(folder):
    kinds, text = described(folder)
    return proposed_mapping(folder, kinds), text


def imported(folder, mapping, tmp_path):
    """Return the presses that a proposal makes as it stands."""
    path = tmp_path / "mapping.yaml"
    documents.write(path, mapping, "import_mapping")
    import_session(folder, path, tmp_path / "session")
    return [read_episode(path) for path in read_session(tmp_path / "session").episodes]


def written(path, header, *columns, between=","):
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [between.join(f"{value}" for value in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([header, *rows]), encoding="utf-8")


def test_folders_of_materials_are_one_kind_of_file_and_specimens(tmp_path):
    source = tmp_path / "source"
    for load, material in enumerate(("Ecoflex 00-30", "Dragon Skin 10", "PDMS"), 3):
        for run in (1, 2):
            written(
                source / material / f"run_{run}.csv", "Time (s),Depth (mm),Load (N)", T, 2 * STROKE, load * run * STROKE
            )
    found, text = proposed(source)
    assert "#/run_#.csv (6 files)" in text
    assert [entry["path"] for entry in found.document["files"].values()] == ["{part0}/run_{part1}.csv"]
    assert found.document["press"] == {"specimen": {"part": "part0"}}
    assert any("Dragon Skin #" in question for question in found.questions)
    assert len(imported(source, found.document, tmp_path)) == 6


def test_folders_whose_words_are_no_materials_are_asked_about(tmp_path):
    for name in ("slow", "fast"):
        written(tmp_path / name / "run_1.csv", "Time (s),Depth (mm),Load (N)", T, 2 * STROKE, 3 * STROKE)
    found, _ = proposed(tmp_path)
    assert "press" not in found.document
    assert "are the folders fast and slow specimens? Then write press: {specimen: {part: part0}}" in found.questions


def test_streams_of_one_trial_stay_apart(tmp_path):
    """Two boards write the same columns and no position: neither is a trial by itself."""
    for name in ("left", "right"):
        written(tmp_path / f"{name}.csv", "t_s,cap0,cap1", T, STROKE, STROKE)
    written(tmp_path / "stage.csv", "t_s,depth_mm", T, STROKE)
    found, _ = proposed(tmp_path)
    assert [entry["path"] for entry in found.document["files"].values()] == [["left.csv", "right.csv"], "stage.csv"]


def test_signs_in_names_belong_to_their_numbers(tmp_path):
    for place in ("x+2.0_y-1.5", "x-2.0_y+1.5", "x+0.0_y+0.0"):
        written(tmp_path / f"gel_{place}.csv", "ms,z_um,s0,s1", (1000 * T).astype(int), -900 * STROKE, STROKE, STROKE)
    found, _ = proposed(tmp_path)
    (entry,) = found.document["files"].values()
    assert entry == {"path": "gel_x{part0}_y{part1}.csv", "time": {"column": "ms"}}, "ms is no channel"
    assert found.document["taxels"]["columns"] == ["s0", "s1"]


def test_sheets_of_the_same_columns_are_trials(tmp_path):
    book = openpyxl.Workbook()
    book.active.append(["Foam, 3 mm"])
    for number in (1, 2, 3):
        sheet = book.create_sheet(f"Run {number}")
        for row in (["Time", "Displacement", "Capacitance"], ["(s)", "(mm)", "(pF)"]):
            sheet.append(row)
        for row in zip(T, number * STROKE, 2 + STROKE, strict=True):
            sheet.append([float(value) for value in row])
    source = tmp_path / "foam.xlsx"
    book.save(source)
    found, _ = proposed(source)
    assert found.document["files"]["run"]["table"] == "Run {part0}"
    assert [press.press.depth for press in imported(source, found.document, tmp_path)] == [1, 2, 3]


def test_trials_along_an_axis_are_found_and_what_is_set_is_no_channel(tmp_path):
    readings = np.stack([np.outer(STROKE, np.arange(1, 5)) * k for k in (1, 2, 3)], axis=2)
    inside = {"t": T[:, None], "V": readings, "disp": np.outer(STROKE, [1, 2, 3]), "rig_speed": np.array([1.0, 2, 5])}
    source = tmp_path / "finger.mat"
    scipy.io.savemat(source, {"S": inside})
    found, _ = proposed(source)
    assert found.document["files"]["finger"]["trial_axis"] == 2
    assert found.document["trials"] == {"column": "trial"}
    assert found.document["taxels"]["columns"] == ["V"]
    presses = imported(source, found.document, tmp_path)
    assert [press.press.depth for press in presses] == [1, 2, 3]


def test_a_place_as_one_array_is_a_position_and_its_numbers_are_no_unit(tmp_path):
    source = tmp_path / "skin.npz"
    np.savez(source, time=T, tip=np.column_stack([0 * T, 0 * T + 2, -STROKE]), cap=np.outer(STROKE, [1, 2, 3]))
    found, _ = proposed(source)
    assert found.document["taxels"]["columns"] == ["cap"]
    assert found.document["position"]["z"]["column"] == "tip[2]"
    assert found.document["contact"]["z"] == 0
    del found.document["position"]["z"]["unit"]
    assert imported(source, found.document, tmp_path)[0].press.depth == 1


def test_an_array_without_names_is_shown_by_column_and_asked_about(tmp_path):
    source = tmp_path / "log.npy"
    np.save(source, np.column_stack([T, 3 + 0 * T, 12 - STROKE, STROKE]))
    found, text = proposed(source)
    assert "array[2]: 11 to 12" in text
    assert found.document["files"]["log"]["time"] == {"column": "array[0]"}
    assert found.document["taxels"]["columns"] == ["array[1-3]"]
    assert any("no names" in question for question in found.questions)
    assert "as it stands, it imports nothing: neither a position" in tried(source, found.mapping)


def test_a_serial_monitors_times_stand_apart_and_its_presses_are_cut(tmp_path):
    rows = [(k, f"{value:.3f},{100 * value + 5:.1f}") for k, value in enumerate(np.tile(STROKE, 3))]
    lines = ["Booting", "13:58:01.000 -> Sensor ok", "13:58:01.100 -> z_mm,p1_Pa"]
    lines += [f"13:58:{2 + 0.05 * k:06.3f} -> {text}" for k, text in rows]
    source = tmp_path / "monitor.txt"
    source.write_text("\n".join(lines))
    found, _ = proposed(source)
    assert found.document["files"]["monitor"]["time"] == {"column": "received"}
    assert found.document["position"]["depth"]["column"] == "z_mm", "it grows from 0 into the skin"
    presses = imported(source, found.document, tmp_path)
    assert [press.press.depth for press in presses] == [1, 1, 1]
    assert tried(source, found.mapping).startswith("tried: the source holds 3 recordings of 70 rows")


def test_pauses_end_trials_and_german_times_are_read(tmp_path):
    clock = np.concatenate([T + pause for pause in (0, 30, 70)])
    stamps = [f"04.11.2023 09:{int(t) // 60:02d}:{t % 60:06.3f}".replace(".", ",").replace(",", ".", 2) for t in clock]
    depth = [f"{value:.3f}".replace(".", ",") for value in np.tile(8 * STROKE, 3)]
    source = tmp_path / "kolben.txt"
    written(source, "Datum Uhrzeit\tWeg [mm]\tKraft [N]", stamps, depth, depth, between="\t")
    found, text = proposed(source)
    assert stamps[0] == "04.11.2023 09:00:00,000"
    assert "missing?" not in text, "a stage at rest at 0 is no missing value"
    assert found.document["files"]["kolben"]["time"] == {"column": "Datum Uhrzeit"}
    assert 0.05 < found.document["trials"]["gap"] < 26
    assert len(imported(source, found.document, tmp_path)) == 3


def test_dates_with_am_and_pm_have_the_month_first_and_it_is_asked(tmp_path):
    stamps = [f"11/4/2023 11:42:{2 + t:06.3f} AM" for t in T]
    written(tmp_path / "log.csv", "Timestamp,Z (mm),B1", stamps, -STROKE, STROKE)
    found, _ = proposed(tmp_path)
    assert found.document["files"]["log"]["time"]["format"] == "%m/%d/%Y %I:%M:%S.%f %p"
    assert any("month first" in question for question in found.questions)


@pytest.mark.parametrize(
    ("name", "values", "entry"),
    [
        ("Extension (mm)", 2.6 + STROKE, {"z": {"column": "Extension (mm)", "scale": -1.0}}),
        ("depth (mm)", -STROKE, {"depth": {"column": "depth (mm)", "scale": -1.0}}),
        ("depth (mm)", STROKE, {"depth": {"column": "depth (mm)"}}),
        ("z (mm)", 12.4 - STROKE, {"z": {"column": "z (mm)"}}),
    ],
)
def test_the_pressing_axis_is_told_from_where_a_trial_begins(tmp_path, name, values, entry):
    written(tmp_path / "log.csv", f"t (s),{name},cap1,cap2", T, values, STROKE, 2 * STROKE)
    found, _ = proposed(tmp_path)
    assert found.document["position"] == {"file": "log", **entry}
    asked = any("Give contact" in question for question in found.questions)
    assert asked == (values.min() > 0), "a height needs the height of the skin"
    press = imported(tmp_path, found.document, tmp_path / "made")[0].press
    assert press.depth == pytest.approx(1)


def test_a_temperature_is_no_time(tmp_path):
    written(tmp_path / "log.csv", "t_s,z_mm,p1_Pa,T_degC", T, STROKE, STROKE, 24 + T)
    found, _ = proposed(tmp_path)
    assert found.document["measured"]["temperature"]["columns"] == ["T_degC"]
    assert found.document["files"]["log"]["time"]["column"] == "t_s"


@pytest.mark.parametrize(("thinned", "rate"), [(1, 50), (4, 10), (7, 5)])
def test_a_file_without_times_is_asked_about_and_its_presses_take_some_seconds(tmp_path, thinned, rate):
    """70, 18 or 10 rows a press, three presses: at 100 rows a second no press would be so short."""
    rows = np.tile(STROKE[::thinned], 3)
    written(tmp_path / "log.csv", "depth (mm),cap1", rows, 2 * rows)
    found, _ = proposed(tmp_path)
    assert found.document["files"]["log"]["time"] == {"rate": rate}
    assert any(f"no column of times; {rate} rows a second is a guess" in question for question in found.questions)


def test_a_copied_file_is_no_second_measurement(tmp_path):
    source = tmp_path / "source"
    for name, depth in (("run_1", 1.0), ("run_2", 2.0)):
        written(source / f"{name}.csv", "t_s,depth_mm,cap1", T, depth * STROKE, STROKE)
    (source / "run_2 - Copy.csv").write_bytes((source / "run_2.csv").read_bytes())
    found, _ = proposed(source)
    path = tmp_path / "mapping.yaml"
    documents.write(path, found.document, "import_mapping")
    made = import_session(source, path, tmp_path / "session")
    assert made.recordings == 2
    assert "run_2 - Copy.csv is the same, byte by byte, as run_2.csv and is left out" in made.notes
    assert not made.refused


def test_a_robots_file_beside_the_skins_is_its_position_in_m(tmp_path):
    """Lengths without a unit are in m where a press would else be a thousandth of a mm."""
    for run in (1, 2):
        trial = tmp_path / f"trial_{run}"
        written(trial / "skin.csv", "timestamp,taxel_0,taxel_1", T, run * STROKE, STROKE)
        written(trial / "robot.csv", "timestamp,tcp_x,tcp_y,tcp_z,fz", T, 0 * T, 0 * T, 0.2 - 0.001 * STROKE, STROKE)
    found, _ = proposed(tmp_path)
    assert found.document["taxels"]["columns"] == ["taxel_0", "taxel_1"]
    assert found.document["position"]["z"] == {"column": "tcp_z", "unit": "m"}
    assert any("m is a guess" in question for question in found.questions)
    assert "pressed 1 mm deep" in tried(tmp_path, found.mapping)


def test_a_file_with_a_channel_a_row_is_long(tmp_path):
    columns = np.repeat(T, 2), np.repeat(STROKE, 2), np.tile([0, 1], len(T)), np.repeat(STROKE, 2)
    written(tmp_path / "log.csv", "time,depth_mm,channel,value", *columns)
    found, _ = proposed(tmp_path)
    assert found.document["taxels"] == {"file": "log", "long": {"channel": "channel", "value": "value"}}


def test_a_number_of_a_place_keeps_its_sign_and_a_place_in_the_path_is_read(tmp_path):
    for x in (-2, -4):
        written(tmp_path / f"x{x}_y1" / "rep1.csv", "time_ms,indent_um,ch1", 1000 * T, 800 * STROKE, x * STROKE)
    found, _ = proposed(tmp_path)
    assert found.document["press"] == {"x": {"part": "part0"}, "y": {"part": "part1"}}
    assert sorted(press.press.x for press in imported(tmp_path, found.document, tmp_path / "made")) == [-4, -2]


def test_variables_whose_names_differ_by_a_number_are_trials(tmp_path):
    source = tmp_path / "runs.mat"
    trials = {f"Trial{k}": {"t": T, "depth": k * STROKE, "cap": np.outer(STROKE, [k, 1])} for k in (1, 2, 3)}
    scipy.io.savemat(source, trials)
    found, _ = proposed(source)
    assert found.document["files"]["trial"]["table"] == "Trial{part0}"
    assert [press.press.depth for press in imported(source, found.document, tmp_path)] == [1, 2, 3]


def test_blocks_side_by_side_are_asked_about_and_are_no_channels(tmp_path):
    written(tmp_path / "b.csv", "Time (s),Disp (mm),C (pF),Time (s),Disp (mm),C (pF)", T, STROKE, STROKE, T, T, T)
    found, _ = proposed(tmp_path)
    assert found.document["taxels"]["columns"] == ["C (pF)"]
    assert any("side by side" in question for question in found.questions)


def test_objects_of_python_are_refused_with_the_way_out(tmp_path):
    np.save(tmp_path / "d.npy", {"t": T}, allow_pickle=True)
    with pytest.raises(FormatError, match=r"objects of Python[\s\S]*np.savez"):
        described(tmp_path / "d.npy")


def test_places_stay_apart_where_nobody_says_the_centre(tmp_path):
    """The median of each trial is that trial's own place: all presses would lie at 0."""
    source = tmp_path / "skin.npz"
    x = np.repeat([-6.0, 0, 6, 0], len(T))
    tip = np.column_stack([x, 3 + 0 * x, -np.tile(STROKE, 4)])
    cap = np.outer(np.tile(STROKE, 4), [1, 2, 3])
    time = np.concatenate([T + 10 * k for k in range(4)])
    np.savez(source, time=time, trial=np.repeat(range(4), len(T)), tip=tip, cap=cap)
    found, _ = proposed(source)
    presses = imported(source, found.document, tmp_path)
    assert [press.press.x for press in presses] == [-6, 0, 6, 0]
    assert [press.tip[0, 0] for press in presses] == [-6, 0, 6, 0]
    assert {press.press.y for press in presses} == {0}, "the centre of all"


def test_a_place_in_the_path_moves_the_tip(tmp_path):
    source = tmp_path / "source"
    for x in (-2, 3):
        written(source / f"x{x}_y1.csv", "time_ms,z_um,ch1", 1000 * T, -800 * STROKE, x * STROKE)
    found, _ = proposed(source)
    presses = imported(source, found.document, tmp_path)
    assert sorted(press.tip[0, 0] for press in presses) == [-2, 3]


def test_a_clock_in_capitals_is_a_time_and_a_copy_of_the_depth_is_no_gauge(tmp_path):
    """A universal testing machine writes the size beside the displacement, and which half of a cycle a row is of."""
    clock, depth = np.tile(T, 4) + np.repeat([0.0, 4, 8, 12], len(T)), np.tile(STROKE, 4)
    half = np.where(np.arange(len(T)) < 35, "Stretch", "Recover")
    cycle = [f"{k + 1}-{word}" for k in range(4) for word in half]
    columns = cycle, clock, 29.2 + depth, depth, 1.3 * depth
    written(tmp_path / "log.csv", "Cycle,Time_S,Size_mm,Displacement_mm,Force_N", *columns)
    found, _ = proposed(tmp_path)
    assert found.document["files"]["log"]["time"] == {"column": "Time_S", "unit": "s"}
    assert found.document["taxels"]["columns"] == ["Force_N"]
    assert found.document["position"]["depth"]["column"] == "Displacement_mm"
    assert "measured" not in found.document, "the size is the displacement from another zero"
    assert any("distinguishes the way in from the way back" in question for question in found.questions)
    assert [press.press.depth for press in imported(tmp_path, found.document, tmp_path / "made")] == [1, 1, 1, 1]


@pytest.mark.parametrize(
    ("header", "unit", "much"),
    [
        ("load_g", "um", "1000 g as 1 mm"),
        ("Force (N)", "mm", "1 N as 1 mm"),
        ("Bend (deg)", "mm", "1 deg as 1 mm"),
        ("Strain [%]", "mm", "1 % as 1 mm"),
        ("Shear strain [%]", "mm", "1 % as 1 mm"),
        ("stretch", "mm", "1 of its units as 1 mm"),
    ],
)
def test_a_force_or_an_angle_stands_for_a_depth_that_nobody_measured(tmp_path, header, unit, much):
    size = 400.0 if unit == "um" else 8.0
    trial, place, deep = (np.repeat(values, len(T)) for values in ([1, 2, 3], [-5, 0, 5], [0.6, 0.9, 1.2]))
    drive, reading = -size * np.tile(STROKE, 3) * deep, 2 + np.tile(STROKE, 3) * deep
    columns = np.tile(T, 3), trial, place, 0 * place, deep, reading, np.gradient(reading), drive
    written(tmp_path / "log.csv", f"t_s,trial,x_location,y_location,z_location,voltage,grad,{header}", *columns)
    found, _ = proposed(tmp_path)
    assert found.document["taxels"]["columns"] == ["voltage"], "neither a place nor a slope reads the skin"
    assert found.document["position"]["depth"] == {"column": header, "unit": unit, "scale": -1.0}
    assert found.questions[0].startswith("no column is a position or a depth") and much in found.questions[0]
    presses = imported(tmp_path, found.document, tmp_path / "made")
    assert [press.press.x for press in presses] == [-5, 0, 5]
    assert max(press.press.depth for press in presses) == pytest.approx(size * 1.2 * (1e-3 if unit == "um" else 1))


@pytest.mark.parametrize(("header", "factor"), [("depth_um", 1000.0), ("depth_mm", 1.0), ("load_g", 400.0)])
def test_presses_are_cut_at_a_depth_in_mm_whatever_the_files_unit(tmp_path, header, factor):
    rows = np.tile(STROKE, 3)
    written(tmp_path / "log.csv", f"t_s,{header},cap1", 0.05 * np.arange(len(rows)), factor * rows, rows)
    found, _ = proposed(tmp_path)
    assert 0 < found.document["trials"]["press_above"] < 0.5
    assert len(imported(tmp_path, found.document, tmp_path / "made")) == 3


def test_rows_of_a_map_are_no_clock(tmp_path):
    """A scan by rows: the second column grows once a row of places, as no time does."""
    x, y = np.tile(np.arange(24), 4), np.repeat([0, 0.5, 1, 1.5], 24)
    written(tmp_path / "map.csv", "0.1,0.0,0.2", x, y, np.sin(x + y))
    found, _ = proposed(tmp_path)
    (entry,) = found.document["files"].values()
    assert "column" not in entry["time"]
    assert any("no column of times" in question for question in found.questions)


def test_a_strain_beside_a_length_reads_nothing(tmp_path):
    columns = T, 2 * STROKE, 20 * STROKE, 5 * STROKE
    written(tmp_path / "log.csv", "Time (s),Extension (mm),Tensile strain (%),Capacitance (pF)", *columns)
    found, _ = proposed(tmp_path)
    assert found.document["taxels"]["columns"] == ["Capacitance (pF)"]
    assert found.document["position"]["depth"]["column"] == "Extension (mm)"


def test_a_header_of_several_lines_may_hold_numbers_and_the_time_has_no_name(tmp_path):
    """As programs of National Instruments write it: a rate, names and units before pairs of times and values."""
    lines = ["Timestamp,2020-03-16,Timestamp,2020-03-16", "Interval,0.05,Interval,0.05"]
    lines += ['Channel name,"Force",Channel name,"Input 1"', 'Unit,"N",Unit,"mm"']
    lines += [f"{t:.2f},{3 * s:.4f},{t:.2f},{s:.4f}" for t, s in zip(T, STROKE, strict=True)]
    (tmp_path / "a3NI.csv").write_text("\n".join(lines))
    found, _ = proposed(tmp_path)
    (entry,) = found.document["files"].values()
    assert entry["time"] == {"column": "Channel name"}
    assert any("rises evenly, and is taken for the time" in question for question in found.questions)
    assert found.document["taxels"]["columns"] == ["Force"]
    assert imported(tmp_path, found.document, tmp_path / "made")[0].press.depth == pytest.approx(1)


def test_numbers_in_brackets_are_no_units_and_states_read_nothing(tmp_path):
    columns = T, 40 * STROKE, STROKE, 0 * T, np.round(STROKE)
    written(tmp_path / "log.csv", "t_s,pos (5),current (5),SegmentID,moving (5)", *columns)
    found, _ = proposed(tmp_path)
    assert found.document["position"]["depth"] == {"column": "pos (5)", "unit": "mm"}
    assert found.document["taxels"]["columns"] == ["current (5)"]
    assert tried(tmp_path, found.mapping).startswith("tried: the source holds 1 recording")


def test_a_depth_of_an_unknown_unit_stops_no_proposal(tmp_path):
    rows = np.tile(STROKE, 3)
    written(tmp_path / "log.csv", "t_s,depth (steps),cap1", 0.05 * np.arange(len(rows)), rows, rows)
    found, _ = proposed(tmp_path)
    assert "unit" in tried(tmp_path, found.mapping)


@pytest.mark.parametrize("kind", ["columns", "records", "rows", "lines"])
def test_json_is_read_by_columns_by_records_and_by_rows(tmp_path, kind):
    rows = [
        {"t_s": t, "tip": {"depth_mm": s}, "caps": [2 * s, None if k == 3 else s]}
        for k, (t, s) in enumerate(zip(T.tolist(), STROKE.tolist(), strict=True))
    ]
    path = tmp_path / "source" / ("run_1.jsonl" if kind == "lines" else "run_1.json")
    path.parent.mkdir()
    if kind == "columns":
        text = json.dumps(
            {"meta": {"rig": "A"}, "t_s": T.tolist(), "depth_mm": STROKE.tolist(), "cap": STROKE.tolist()}
        )
    elif kind == "records":
        text = json.dumps({"samples": rows})
    elif kind == "rows":
        text = json.dumps({"data": np.column_stack([T, STROKE, 2 * STROKE]).tolist()})
    else:
        text = "\n".join(json.dumps(row) for row in rows)
    path.write_text(text)
    (path.parent / "settings.json").write_text('{"speeds": [1, 2, 5]}')
    found, described_as = proposed(path.parent)
    assert "settings.json holds no 10 rows" in described_as
    if kind == "rows":
        assert found.document["files"]["run"]["time"] == {"column": "data[0]"}
        assert any("no names" in question for question in found.questions)
        return
    (press,) = imported(path.parent, found.document, tmp_path / "made")
    assert press.press.depth == pytest.approx(1)
    assert press.taxels.counts.shape[1] == (1 if kind == "columns" else 2)


def test_a_piston_that_goes_to_both_sides_has_no_side_without_contact(tmp_path):
    """Friction turns with the way, wherever the piston is: half of its strokes are no flight."""
    way = 0.4 * np.sin(2 * np.pi * T / T[-1] * 3)
    force = 30 * np.tanh(40 * np.gradient(way, T))
    written(tmp_path / "log.csv", "t_s,disp_in,F_N", T, way, force)
    found, _ = proposed(tmp_path)
    low = -25.4 * way.min()
    assert found.document["position"]["depth"]["offset"] == pytest.approx(low, abs=2e-3)
    assert any("both sides" in question for question in found.questions)
    assert min(press.tip[:, 2].min() for press in imported(tmp_path, found.document, tmp_path / "a")) > -1e-3
    del found.document["position"]["depth"]["offset"], found.document["trials"]
    path = tmp_path / "without.yaml"
    documents.write(path, found.document, "import_mapping")
    made = import_session(tmp_path / "log.csv", path, tmp_path / "session")
    assert any("does it touch there, too?" in note and f"offset: {low:.2f}"[:-1] in note for note in made.notes)


def test_a_tip_that_comes_from_the_air_and_one_that_sticks_have_a_side_without_contact(tmp_path):
    depth = 3 * STROKE - 1.5 * (STROKE == 0)
    stuck = np.where((depth < 0) & (np.arange(len(T)) > 40), -0.1, 0.0)
    written(tmp_path / "log.csv", "t_s,depth_mm,F_N", T, depth, np.maximum(depth, 0) + stuck)
    found, _ = proposed(tmp_path)
    assert "offset" not in found.document["position"]["depth"]


def test_cycles_that_begin_at_once_keep_their_sign(tmp_path):
    """The first rows of a long file hold a whole stroke: they are no rest."""
    time = np.arange(0, 60, 0.02)
    depth = 2 * np.clip(np.sin(2 * np.pi * time / 6), -0.3, 1)
    written(tmp_path / "log.csv", "t_s,depth_mm,reading", time, depth, 50 * np.maximum(depth, 0) ** 1.3)
    found, _ = proposed(tmp_path)
    assert "scale" not in found.document["position"]["depth"]
    assert "offset" not in found.document["position"]["depth"]


def test_a_line_that_broke_off_is_told_by_its_number(tmp_path):
    rows = [f'{{"t_s": {0.02 * k}, "depth_mm": {k % 9}, "r": {k}}}' for k in range(30)]
    (tmp_path / "log.jsonl").write_text("\n".join([*rows, rows[0][:12]]))
    table = read_table(tmp_path / "log.jsonl")
    assert table.rows == 30 and table.doubts == ("log.jsonl: 1 line is cut off or no JSON, first line 31: left out",)
    (tmp_path / "log.jsonl").write_text("\n".join([*rows, *[rows[0][:12]] * 2]))
    with pytest.raises(FormatError, match=r"2 of 32 lines are no JSON, first line 31"):
        described(tmp_path / "log.jsonl")
