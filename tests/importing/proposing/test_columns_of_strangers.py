"""Columns that are easily taken for others: counters, counts, force-torque arrays, trials side by side, other signs."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat
from sources import mapping

from tacdata.chain.at_rest import below_zero, turned, zero_side
from tacdata.errors import FormatError
from tacdata.importing.formats.source_format import read_table
from tacdata.importing.imported_session import import_session
from tacdata.importing.proposing.description import described
from tacdata.importing.proposing.proposal import proposed_mapping
from tacdata.importing.proposing.roles import roles_of
from tacdata.importing.proposing.trial_run import tried
from tacdata.importing.text.layout import are_units
from tacdata.importing.units import split_unit

T = np.arange(200) / 20
DEPTH = np.interp(T, [0, 1, 2, 3, 4, 6, 7, 8, 9, 10], [-0.3, -0.3, 1.0, 1.0, -0.3, -0.3, 1.0, 1.0, -0.3, -0.3])
FORCE = 2 * np.maximum(DEPTH, 0) + np.random.default_rng(0).normal(0, 0.005, len(T))
CHANNEL = 10 + 2 * FORCE


def written(folder, head, *columns, name="run.csv", between=","):
    folder.mkdir(exist_ok=True)
    rows = [between.join(f"{value:.12g}" for value in row) for row in zip(*columns, strict=True)]
    (folder / name).write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return folder / name


def proposed(folder):
    return proposed_mapping(folder, described(folder)[0])


@pytest.mark.parametrize("counter", [np.arange(200), 1000 + 10 * np.arange(200), (65_500 + np.arange(200)) % 65_536])
def test_a_counter_next_to_a_load_cell_is_no_channel(tmp_path, counter):
    path = written(tmp_path, "Reading,Load [lbF],Travel [in],Time [s]", counter, FORCE, DEPTH / 25.4, T)
    roles = roles_of(read_table(path))
    assert (roles["idle"], roles["channels"], roles["force"]) == (["Reading"], [], ["Load [lbF]"])
    assert [q for q in proposed(tmp_path).questions if "Reading" in q]


def test_numbered_constants_next_to_a_load_cell_are_a_dead_sensor(tmp_path):
    path = written(tmp_path, "t,depth,Fz,c0,c1", T, DEPTH, FORCE, 0 * T, 0 * T)
    assert roles_of(read_table(path))["channels"] == ["c0", "c1"]


def test_torques_without_a_unit_go_with_the_forces(tmp_path):
    path = written(tmp_path, "t,depth,Fx,Fy,Fz,Tx,My,c0", T, DEPTH, *[FORCE] * 5, CHANNEL)
    roles = roles_of(read_table(path))
    assert (roles["torque"], roles["force"], roles["channels"]) == (["Tx", "My"], ["Fx", "Fy", "Fz"], ["c0"])


@pytest.mark.parametrize(
    ("head", "columns", "units"),
    [
        ("Counts Per Force: 1000000 (N)\nt,Fz,depth", (T, np.rint(1e6 * FORCE), DEPTH), {"Fz": "1/1000000 N"}),
        (
            "# 10000 counts per N, 400 counts per mm\nt,Fz,enc_count",
            (T, np.rint(1e4 * FORCE), np.rint(400 * DEPTH)),
            {"Fz": "1/10000 N", "enc_count": "1/400 mm"},
        ),
        (
            "# encoder: 0.0025 mm/count, load cell: 0.0001 N/count\nt,load,encoder",
            (T, np.rint(1e4 * FORCE), np.rint(400 * DEPTH)),
            {"load": "0.0001 N", "encoder": "0.0025 mm"},
        ),
        ("# 1 tick = 500 us\ntick,Fz,depth", (np.rint(2000 * T), FORCE, DEPTH), {"tick": "500 us"}),
        ("Counts Per Force: 1000000 (N)\nt,Fz,depth", (T, FORCE, DEPTH), {}),  # no whole numbers: N already
    ],
)
def test_counts_are_of_the_size_that_the_head_states(tmp_path, head, columns, units):
    assert read_table(written(tmp_path, head, *columns)).units == units


def test_whole_numbers_without_a_unit_are_not_called_newtons(tmp_path):
    written(tmp_path, "t,depth,Fz,c0", T, DEPTH, np.rint(1e6 * FORCE), CHANNEL)
    assert any("how many are a newton" in q for q in proposed(tmp_path).questions)


@pytest.mark.parametrize(
    ("name", "unit"), [("observations.ft", ""), ("wrist_ft", ""), ("tool/ft", ""), ("z [ft]", "ft"), ("z (ft)", "ft")]
)
def test_a_force_torque_sensor_is_not_measured_in_feet(name, unit):
    assert split_unit(name)[1] == unit


def test_an_array_of_a_wrist_is_force_and_torque(tmp_path):
    wrench = np.column_stack([0 * T, 0 * T, FORCE, 0 * T, 0 * T, 0 * T])
    pose = np.column_stack([0 * T, 0 * T, -DEPTH])
    np.savez(tmp_path / "run.npz", t=T, wrist_ft=wrench, ee_pos=pose, gel=np.column_stack([CHANNEL, 2 * CHANNEL]))
    found = proposed(tmp_path)
    assert found.document["measured"]["force"]["columns"] == ["wrist_ft[0]", "wrist_ft[1]", "wrist_ft[2]"]
    assert found.document["taxels"]["columns"] == ["gel"]
    assert any("give unit: N, mN" in q for q in found.questions)


def test_a_force_in_a_unit_of_length_is_refused(tmp_path):
    written(tmp_path / "source", "t,depth,Fz,c0", T, DEPTH, FORCE, CHANNEL)
    force = {"file": "run", "columns": "Fz", "unit": "ft"}
    path = mapping(tmp_path, tmp_path / "run.csv", taxels={"file": "run", "columns": ["c0"]}, measured={"force": force})
    with pytest.raises(FormatError, match="unit 'ft'") as caught:
        import_session(tmp_path / "source", path, tmp_path / "session")
    assert "N, mN" in caught.value.allowed


@pytest.mark.parametrize("names", ["t,depth,c0", "t,temp,depth,c0,c1"])
def test_another_number_of_names_than_of_values_is_refused(tmp_path, names):
    with pytest.raises(FormatError, match=f"{names.count(',') + 1} names in the header, and 4 values") as caught:
        read_table(written(tmp_path, names, T, DEPTH, CHANNEL, CHANNEL))
    assert "header: false" in caught.value.remedy


@pytest.mark.parametrize(
    "names", [("A t", "A z", "A F", "B t", "B z", "B F"), ("1 t", "1 z", "1 F", "2 t", "2 z", "2 F")]
)
def test_trials_below_their_names_are_not_mixed(tmp_path, names):
    written(tmp_path, ",".join(names) + "\ns,mm,N,s,mm,N", T, DEPTH, FORCE, 2 * T, 1.2 * DEPTH, 3 * FORCE)
    found = proposed(tmp_path)
    assert any("each name comes again" in q for q in found.questions)
    assert found.document["taxels"]["columns"] == [names[2]]


@pytest.mark.parametrize(("name", "sign"), [("depth", 1), ("z", 1), ("z", -1)])
def test_presses_that_go_to_the_other_side_of_zero_are_asked_about(tmp_path, name, sign):
    path, skin = sign * np.tile(DEPTH, 2), np.tile(CHANNEL, 2)
    path[200:] *= -1
    written(tmp_path, f"t [s],{name} [mm],c0,c1", np.arange(400) / 20, path, skin, 2 * skin)
    found = proposed(tmp_path)
    row = next(int(q.split("from row ")[1].split()[0]) for q in found.questions if "other side of zero" in q)
    assert 220 <= row <= 240 and "offset" not in found.document["position"].get("depth", {})


def test_recordings_of_another_sign_are_told():
    sides = [zero_side(sign * DEPTH, CHANNEL[:, None]) for sign in (1, 1, -1)]
    assert turned(sides) == [2] and below_zero(sides) == 0


def test_a_piston_is_pressed_on_both_sides_of_zero():
    way = np.sin(T)
    assert not turned([zero_side(way, way[:, None])]) and below_zero([zero_side(way, way[:, None])]) == pytest.approx(
        1, abs=0.01
    )


def test_readings_in_a_text_are_asked_about(tmp_path):
    rows = [
        {"t": t, "depth_mm": d, "fz_N": f, "data": f"{k:X},{2 * k:X}"}
        for k, (t, d, f) in enumerate(zip(T, DEPTH, FORCE, strict=True))
    ]
    (tmp_path / "run.jsonl").write_text("\n".join(map(json.dumps, rows)))
    assert any("data holds text" in q for q in proposed(tmp_path).questions)


def test_one_file_of_one_specimen_needs_no_part_of_its_path(tmp_path):
    written(tmp_path, "t [s],depth [mm],c0,c1", T, DEPTH, CHANNEL, CHANNEL, name="Probe 1.csv")
    found = proposed(tmp_path)
    assert "press" not in found.document
    assert "2 recordings" in tried(tmp_path, found.mapping)


@pytest.mark.parametrize(
    "line",
    [
        "[{0:.2f} s] depth={1:.3f} mm, load={2:.1f} mN, cap={3:.3f} pF",
        "10:00:{0:06.3f} -> depth: {1:.3f} mm | load: {2:.1f} mN | cap: {3:.3f} pF",
    ],
)
def test_lines_of_a_monitor_with_units_are_columns(tmp_path, line):
    texts = [line.format(*row) for row in zip(T, DEPTH, 1000 * FORCE, CHANNEL, strict=True)]
    (tmp_path / "run.log").write_text("\n".join(["ready", *texts]) + "\n")
    found = proposed(tmp_path)
    assert found.document["measured"]["force"]["unit"] == "mN"
    assert found.document["taxels"]["columns"] == ["cap [pF]"]
    assert "2 recordings" in tried(tmp_path, found.mapping) and "at 20 Hz" in tried(tmp_path, found.mapping)


@pytest.mark.parametrize("keys", [False, True])
def test_trials_of_a_json_file_are_below_one_another(tmp_path, keys):
    trials = [
        {"id": k, "depth": list(k * DEPTH[:150]), "force": list(FORCE[:150]), "skin": [[c, c] for c in CHANNEL[:150]]}
        for k in (1, 2)
    ]
    data = {f"trial_{trial['id']}": trial for trial in trials} if keys else trials
    settings = {"sampling_rate_hz": 20, "units": {"depth": "mm", "force": "mN"}}
    (tmp_path / "all.json").write_text(json.dumps({"metadata": settings, "data": data}))
    table = read_table(tmp_path / "all.json")
    assert table.rows == 300 and table.rate == 20 and table.column("data.skin").shape == (300, 2)
    assert table.column("data.element").tolist() == [0] * 150 + [1] * 150
    assert {table.units["data.depth"], table.units["data.force"]} == {"mm", "mN"}


def test_samples_with_a_list_of_readings_are_no_trials(tmp_path):
    rows = [{"t": t, "skin": [c] * 16, "raw": [c] * 16} for t, c in zip(T, CHANNEL, strict=True)]
    (tmp_path / "run.json").write_text(json.dumps(rows))
    assert read_table(tmp_path / "run.json").column("skin").shape == (200, 16)


def test_names_of_several_levels_hold_the_unit(tmp_path):
    frame = pd.DataFrame(
        {("daq", "load", "mN"): 1000 * FORCE, ("stage", "depth", "um"): 1000 * DEPTH, ("skin", 1, ""): CHANNEL}
    )
    frame.columns = [str(name) for name in frame.columns]
    frame.to_parquet(tmp_path / "run.parquet")
    table = read_table(tmp_path / "run.parquet")
    assert list(table.columns) == ["daq load", "stage depth", "skin 1"]
    assert table.units == {"daq load": "mN", "stage depth": "um"}


@pytest.mark.parametrize(
    "head",
    ["Sampling cycle,50ms", "Sampling Cycle(s),0.05", "Recording interval: 50 ms", "fs = 20", "sampling_rate_hz: 20"],
)
def test_a_rate_is_read_however_the_head_states_it(tmp_path, head):
    assert read_table(written(tmp_path, head + "\n\nNo.,z [mm],Fz [N]", np.arange(200), DEPTH, FORCE)).rate == 20


def test_units_may_be_words():
    assert are_units(["Newtons", "Millimeters", "Pounds", "Volts"])


def test_a_cycle_with_holds_is_one_trial(tmp_path):
    phases = np.where(np.gradient(DEPTH) > 0.01, "load", np.where(np.gradient(DEPTH) < -0.01, "unload", "hold"))
    rows = [f"C{1 + (t > 5)}_{p},{t:.2f},{d:.4f},{f:.4f}" for p, t, d, f in zip(phases, T, DEPTH, FORCE, strict=True)]
    (tmp_path / "run.csv").write_text("\n".join(["cycle,time_s,position_mm,load_N", *rows]))
    found = proposed(tmp_path)
    assert "column" not in found.document["trials"] and "2 recordings" in tried(tmp_path, found.mapping)


def test_a_word_in_place_of_many_readings_is_asked_about(tmp_path):
    cells = ["+OVER" if c > 13 else f"{c:.3f}" for c in CHANNEL]
    rows = [f"{t:.2f},{d:.4f},{c}" for t, d, c in zip(T, DEPTH, cells, strict=True)]
    (tmp_path / "run.csv").write_text("\n".join(["t [s],depth [mm],c0", *rows]))
    found = proposed(tmp_path)
    assert any("+OVER in run.csv: taken for no value" in q for q in found.questions)
    assert found.document["files"]["run"]["missing"] == ["+OVER"]


def test_a_letter_in_volts_is_no_depth(tmp_path):
    roles = roles_of(read_table(written(tmp_path, "t [s],z [mm],a [V],d [V]", T, DEPTH, CHANNEL, CHANNEL)))
    assert roles["channels"] == ["a [V]", "d [V]"] and "depth" not in roles


@pytest.mark.parametrize(
    "names",
    [
        "Time (s) Run #1,Position (mm) Run #1,Force (N) Run #1,Time (s) Run #2,Position (mm) Run #2,Force (N) Run #2",
        "S 1 t,S 1 z,S 1 F,,S 2 t,S 2 z,S 2 F",
    ],
)
def test_trials_side_by_side_are_known_by_any_number_in_their_names(tmp_path, names):
    columns = (T, DEPTH, FORCE, *[np.full(len(T), np.nan)] * names.count(",,"), 2 * T, 1.2 * DEPTH, 3 * FORCE)
    written(tmp_path, names, *columns)
    assert any("each name comes again" in q for q in proposed(tmp_path).questions)


def test_packets_that_are_lost_are_a_gap_whatever_their_number_is_called(tmp_path):
    rows = np.setdiff1d(np.arange(200), np.arange(110, 117))
    written(tmp_path, "# sample rate 20 Hz\npkt,z [mm],Fz [N],c0", rows % 64, DEPTH[rows], FORCE[rows], CHANNEL[rows])
    found = proposed(tmp_path)
    assert found.document["files"]["run"]["time"] == {"rate": 20.0, "column": "pkt"}


def test_columns_of_an_array_by_number_are_a_place_and_a_wrench(tmp_path):
    names = ["t", *(f"pos_{k}" for k in (1, 2, 3)), *(f"FT[{k}]" for k in range(6)), "tac_1", "tac_2", "tac_3"]
    columns = [T, 0 * T, 0 * T, 80 - DEPTH, *[FORCE] * 6, CHANNEL, CHANNEL, CHANNEL]
    roles = roles_of(read_table(written(tmp_path, ",".join(names), *columns)))
    assert (roles["z"], roles["force"], roles["torque"]) == (["pos_3"], names[4:7], names[7:10])
    assert roles["channels"] == names[10:]


@pytest.mark.parametrize("form", ["mat", "npz"])
def test_an_array_of_names_names_the_columns_of_a_table(tmp_path, form):
    data, names = np.column_stack([T, DEPTH, FORCE, CHANNEL]), ["time (s)", "depth (mm)", "Fz (N)", "c0 (pF)"]
    if form == "mat":
        savemat(tmp_path / "run.mat", {"data": data, "labels": np.array(names, dtype=object)})
    else:
        np.savez(tmp_path / "run.npz", data=data, labels=np.array(names))
    assert list(read_table(tmp_path / f"run.{form}").columns) == names
    assert "2 recordings" in tried(tmp_path, proposed(tmp_path).mapping)


def test_comments_may_name_columns_and_units(tmp_path):
    head = "# columns: height vDeflection seriesTime\n# other: 1 2\n# units: m N s"
    table = read_table(written(tmp_path, head, -DEPTH / 1000, FORCE, T, name="run.txt", between=" "))
    assert table.units == {"height": "m", "vDeflection": "N", "seriesTime": "s"}


def test_a_load_cell_at_its_limit_is_told(tmp_path):
    written(tmp_path / "source", "t,depth,Fz,c0,c1", T, DEPTH, np.minimum(FORCE, 1.0), CHANNEL, CHANNEL)
    force = {"file": "run", "columns": "Fz", "unit": "N"}
    path = mapping(tmp_path, tmp_path / "run.csv", measured={"force": force})
    made = import_session(tmp_path / "source", path, tmp_path / "session")
    assert any("force: 1 channel saturates: Fz stays at 1 for" in note for note in made.notes)


def test_a_ramp_and_its_hold_with_a_number_more_are_one_trial(tmp_path):
    for trial in (1, 2):
        folder = tmp_path / f"pad-{trial}" / f"Test Run {trial}"
        ramp, depth = slice(0, 41), trial * np.maximum(DEPTH, 0)
        hold = slice(41, 60)
        head = "Crosshead \tLoad \tTime \nmm\tN\tsec"
        folder.parent.mkdir()
        for part, rows in (("", ramp), ("1", hold)):
            columns = (-depth[rows], FORCE[rows] + 0.001 * trial, T[rows])
            written(folder, head, *columns, name=f"DAQ - (Timed){part}.txt", between="\t")
    found = proposed(tmp_path)
    said = tried(tmp_path, found.mapping)
    assert "2 of 2 sets of files hold 2 recordings of 60 rows" in said and "not good" not in said


def test_a_monitor_without_numbers_is_refused_by_its_name(tmp_path):
    (tmp_path / "serial.txt").write_text("".join(f"10:00:{k:06.3f} -> waiting for the board\n" for k in range(40)))
    with pytest.raises(FormatError, match=r"serial\.txt: no row of numbers"):
        read_table(tmp_path / "serial.txt")


def test_decimal_commas_are_no_names_of_rows(tmp_path):
    rows = "\n".join(
        f"{t:.3f};{d:.4f};{c:.4f};{c:.4f}".replace(".", ",") for t, d, c in zip(T, DEPTH, CHANNEL, strict=True)
    )
    (tmp_path / "run.csv").write_text(f"Zeit [s];Weg [mm];K1\n{rows}\n")
    with pytest.raises(FormatError, match="3 names in the header, and 4 values"):
        read_table(tmp_path / "run.csv")


def test_a_text_called_frame_is_no_counter(tmp_path):
    rows = [f"{t:.2f},{d:.4f},{f:.4f},{k:X} {2 * k:X}" for k, (t, d, f) in enumerate(zip(T, DEPTH, FORCE, strict=True))]
    (tmp_path / "run.csv").write_text("\n".join(["t [s],z [mm],Fz [N],frame", *rows]))
    assert any("frame holds text" in q for q in proposed(tmp_path).questions)
