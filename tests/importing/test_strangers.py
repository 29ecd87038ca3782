"""Files as strangers keep them, proposed and imported as they stand: right figures, or words that say why not."""

import json

import h5py
import numpy as np
import openpyxl
import pytest
import yaml
from scipy.io import savemat
from sources import NAMES, table

from tacdata.errors import TacdataError
from tacdata.importing.formats.source_format import read_table
from tacdata.importing.imported_session import import_session
from tacdata.importing.proposing.description import described
from tacdata.importing.proposing.proposal import proposed_mapping
from tacdata.importing.proposing.roles import roles_of
from tacdata.recording import read_session
from tacdata.recording.files.reader import read_episode

ROWS = table()


def lines(rows, mark=",", names=NAMES, places=4):
    """Return rows as text below their names."""
    return "\n".join([mark.join(names), *(mark.join(f"{value:.{places}f}" for value in row) for row in rows)]) + "\n"


def grouped(sign, decimal, mark):
    """Return rows whose channels are in fF, with a sign between thousands."""
    swap = str.maketrans({",": sign, ".": decimal})
    cells = [
        [f"{v:.4f}".translate(swap) for v in r[:2]] + [f"{v:,.1f}".translate(swap) for v in 1000 * r[2:]] for r in ROWS
    ]
    return "\n".join([mark.join(NAMES).replace("pF", "fF"), *(mark.join(row) for row in cells)]) + "\n"


def imported(folder, files):
    """Return the recordings of files that are imported by their proposal, and the proposal's questions."""
    source = folder / "files"
    source.mkdir()
    for name, text in files.items():
        (source / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return of(source)


def of(source):
    """Return the recordings of a source by its proposal, and the proposal's questions."""
    proposal = proposed_mapping(source, described(source)[0])
    place = source.parent / "mapping.yaml"
    place.write_text(yaml.safe_dump(proposal.document))
    made = import_session(source, place, source.parent / "session")
    return [read_episode(path) for path in read_session(made.folder).episodes], [*proposal.questions, *made.notes]


def are_right(episodes, count=2, scale=1.0):
    """Whether depth, rate and first channel of each recording are those of the table."""
    assert len(episodes) == count
    for episode in episodes:
        assert episode.press.depth == pytest.approx(1.2, rel=1e-3)
        assert np.median(np.diff(episode.taxels.sample_ns)) == 50_000_000
        depth = np.interp(episode.taxels.sample_ns, episode.tip_ns, episode.tip[:, 2])
        assert np.abs(episode.taxels.counts[:, 0] / scale - 10 - depth).max() < 0.05


@pytest.mark.parametrize(
    ("sign", "decimal", "mark"), ((".", ",", ";"), ("'", ".", ";"), ("\u202f", ",", ";"), (",", ".", "\t"))
)
def test_signs_between_thousands_are_read_where_the_decimal_sign_is_clear(tmp_path, sign, decimal, mark):
    episodes, _ = imported(tmp_path, {"run.csv": grouped(sign, decimal, mark)})
    are_right(episodes, scale=1000.0)


def test_whole_thousands_next_to_decimals_are_refused_as_unclear(tmp_path):
    text = grouped(".", ",", ";").replace(",0\n", "\n")
    text = "\n".join(
        ";".join([*row.split(";")[:2], *(c.partition(",")[0] for c in row.split(";")[2:])]) for row in text.split("\n")
    )
    with pytest.raises(TacdataError, match="does it separate thousands"):
        imported(tmp_path, {"run.csv": text})


@pytest.mark.parametrize(
    "text",
    (
        "\n".join(f"t_s:{a:.2f},depth_mm:{b:.4f},c0:{c:.4f},c1:{d:.4f}" for a, b, c, d in ROWS),
        "\n".join(f"t_s={a:.2f} depth_mm={b:.4f} c0={c:.4f} c1={d:.4f}" for a, b, c, d in ROWS),
        "t depth c0 c1\n" + "\n".join(" ".join(f"{v:+.5E}".replace("E", "D") for v in row) for row in ROWS),
        "# settings: " + "a0b1" * 75_000 + "\n" + lines(ROWS),
        json.dumps({"columns": list(NAMES), "index": list(range(len(ROWS))), "data": ROWS.tolist()}),
    ),
    ids=("labels", "keys", "fortran", "long line", "split by pandas"),
)
def test_forms_of_rows(tmp_path, text):
    name = "run.json" if text.startswith("{") else "run.txt"
    are_right(imported(tmp_path, {name: text})[0])


def test_files_in_different_units_are_read_each_in_its_own(tmp_path):
    inches = lines(ROWS / [1, 25.4, 1, 1], names=("t [s]", "depth [in]", *NAMES[2:]), places=7)
    are_right(imported(tmp_path, {"run_1.csv": lines(ROWS), "run_2.csv": inches})[0], 4)


def test_other_units_in_mid_file_are_refused(tmp_path):
    head = ("t,depth,c0,c1\ns,mm,pF,pF\n", "t,depth,c0,c1\ns,cm,pF,pF\n")
    parts = [lines(part, names=()).lstrip() for part in (ROWS[:120], ROWS[120:] / [1, 10, 1, 1])]
    with pytest.raises(TacdataError, match="other units"):
        imported(tmp_path, {"run.csv": head[0] + parts[0] + head[1] + parts[1]})


def test_trials_side_by_side_are_not_taken_for_channels(tmp_path):
    for number, names in enumerate(
        ((*NAMES, *(f"{name}.1" for name in NAMES)), [f"{n}_{k}" for k in (1, 2) for n in ("t", "depth", "c0", "c1")])
    ):
        (tmp_path / str(number)).mkdir()
        episodes, said = imported(tmp_path / str(number), {"run.csv": lines(np.hstack([ROWS, ROWS]), names=names)})
        assert {episode.taxels.counts.shape[1] for episode in episodes} == {2}
        assert any("only the first is read" in text for text in said)


def test_rows_that_were_never_filled_are_no_presses(tmp_path):
    filled = np.zeros((1000, 4))
    filled[: len(ROWS)] = ROWS
    (tmp_path / "files").mkdir()
    np.savez(tmp_path / "files" / "run.npz", t=filled[:, 0], depth=filled[:, 1], c=filled[:, 2:])
    episodes, said = of(tmp_path / "files")
    are_right(episodes)
    assert any("800 rows at its end hold zeros alone" in text for text in said)


def test_a_position_in_steps_is_no_length(tmp_path):
    with pytest.raises(TacdataError, match="unit 'steps'"):
        imported(tmp_path, {"run.csv": lines(ROWS * [1, 400, 1, 1], names=("t [s]", "z_steps", *NAMES[2:]))})


def test_a_rate_without_a_unit_is_in_hertz(tmp_path):
    text = '# {"sampling rate": 20, "device": "a"}\n' + lines(ROWS[:, 1:], names=NAMES[1:])
    are_right(imported(tmp_path, {"run.txt": text})[0])


def test_the_actions_of_a_policy_are_no_readings(tmp_path):
    (tmp_path / "files").mkdir()
    with h5py.File(tmp_path / "files" / "run.h5", "w") as file:
        for trial in (0, 1):
            rows = table(seed=trial)  # a copy would be left out
            for name, values in (("obs/t", rows[:, 0]), ("obs/depth", rows[:, 1]), ("obs/c", rows[:, 2:])):
                file[f"data/demo_{trial}/{name}"] = values
            file[f"data/demo_{trial}/actions"] = np.ones((len(rows), 4))
    are_right(of(tmp_path / "files")[0], 4)


def test_two_boards_in_one_file_stand_side_by_side(tmp_path):
    (tmp_path / "files").mkdir()
    with h5py.File(tmp_path / "files" / "run.h5", "w") as file:
        for name, columns in (("stage/depth", 1), ("left/c", slice(2, 4)), ("right/c", slice(2, 4))):
            file[name], file[f"{name.partition('/')[0]}/t"] = ROWS[:, columns], ROWS[:, 0]
    episodes, _ = of(tmp_path / "files")
    are_right(episodes)
    assert episodes[0].taxels.counts.shape[1] == 4


FORCE = 2.0 * ROWS[:, 1:2] ** 1.5
LABVIEW = "Y_Unit_Label\tmm\tN\tVolts\tVolts\nX0\t0\t0\t0\t0\n***End_of_Header***\t\t\t\t\n"


@pytest.mark.parametrize(
    ("names", "further", "head"),
    (
        (("Fz (N)", "Tz (N-mm)"), [-FORCE, 3 * FORCE], ""),
        (("wrench.force.z [N]", "wrench.torque.x [Nm]"), [-FORCE, FORCE], ""),
        (("/ft/wrench/force/z [N]", "/ft/wrench/torque/z [N m]"), [FORCE, FORCE], ""),
    ),
)
def test_forces_and_torques_of_a_wrench_are_neither_place_nor_readings(tmp_path, names, further, head):
    rows = np.hstack([ROWS, *further])
    episodes, _ = imported(tmp_path, {"run.csv": head + lines(rows, names=(*NAMES, *names))})
    are_right(episodes)
    measured = {stream.name: stream for stream in episodes[0].measured}
    assert set(measured) == {"force", "torque"}
    assert measured["force"].unit == "N"
    assert np.abs(measured["force"].values).max() == pytest.approx(2 * 1.2**1.5, rel=1e-3)


def test_the_state_of_a_robot_is_no_reading(tmp_path):
    names = ("timestamp", "actual_TCP_pose_2", "register_0", "register_1")
    state = tuple(f"actual_{name}_{k}" for name in ("q", "qd", "current", "TCP_force") for k in (0, 5))
    rows = np.hstack([ROWS[:, :1], 0.3 - ROWS[:, 1:2] / 1000, ROWS[:, 2:], *[FORCE + k for k in range(8)]])
    episodes, said = imported(tmp_path, {"run.csv": lines(rows, names=(*names, *state), places=7)})
    are_right(episodes)
    assert episodes[0].taxels.counts.shape[1] == 2
    assert any("no unit is given: give unit: N" in text for text in said)


@pytest.mark.parametrize("parts", (("stamp.secs", "stamp.nsecs", 1_000_000_000), ("tv_sec", "tv_usec", 1_000_000)))
def test_seconds_and_their_parts_are_one_time(tmp_path, parts):
    first, second, size = parts
    ticks = np.rint((ROWS[:, 0] + 1_790_000_000.0) * 20).astype(int)
    clock = [f"{tick // 20},{tick % 20 * size // 20}" for tick in ticks]
    rows = lines(ROWS[:, 1:], names=NAMES[1:]).split("\n")
    head = f"{first},{second},{rows[0]}"
    are_right(imported(tmp_path, {"run.csv": "\n".join([head, *map(",".join, zip(clock, rows[1:], strict=False))])})[0])


def test_zones_by_name_are_read_across_the_end_of_summer_time(tmp_path):
    utc = np.datetime64("2026-10-25T00:59:55") + np.rint(ROWS[:, 0] * 1000).astype("timedelta64[ms]")
    summer = utc < np.datetime64("2026-10-25T01:00:00")
    stamps = [f"{t + np.timedelta64(1 + s, 'h')} {'CEST' if s else 'CET'}" for t, s in zip(utc, summer, strict=True)]
    rows = lines(ROWS[:, 1:], names=NAMES[1:]).split("\n")
    text = "\n".join(
        ["stamp," + rows[0], *(f"{t.replace('T', ' ', 1)},{row}" for t, row in zip(stamps, rows[1:], strict=False))]
    )
    are_right(imported(tmp_path, {"run.csv": text})[0])


def test_the_line_of_units_above_labview_names_is_read(tmp_path):
    names = ("X_Value", "Weg", "Kraft", "Sensor_0", "Sensor_1")
    rows = np.hstack([ROWS[:, :2], FORCE, ROWS[:, 2:]])
    episodes, said = imported(tmp_path, {"run.lvm": LABVIEW + lines(rows, "\t", names)})
    are_right(episodes)
    assert [stream.unit for stream in episodes[0].measured] == ["N"]
    assert not any("no unit is given" in text for text in said)


def test_a_text_with_an_ending_of_its_own_is_read_where_nothing_else_is(tmp_path):
    are_right(imported(tmp_path, {"series.TRA": lines(ROWS)})[0])
    (tmp_path / "beside").mkdir()
    are_right(imported(tmp_path / "beside", {"run.csv": lines(ROWS), "old.backup": lines(ROWS[:50])})[0])


@pytest.mark.parametrize("noise", (b"\xff\xfe\x80,8", b"\x00\x10,9\x00", b"\xff\xfe\x00"))
def test_noise_of_a_port_before_the_first_line_hides_nothing(tmp_path, noise):
    """Two bytes of it may look like the mark of UTF-16. The head states the size of the encoder's counts."""
    rows = lines(np.round(ROWS * [1000, 800, 1, 1], 4), names=("millis", "enc", "c0", "c1"))
    text = noise + b"\r\nready\r\n# encoder: 800 counts/mm\r\n" + rows.replace(".0000,", ",").encode()
    are_right(imported(tmp_path, {"run.log": text})[0])


def test_durations_with_days_and_names_with_brackets_are_read(tmp_path):
    names = ("elapsed", NAMES[1], "/skin/raw[0]", "/skin/raw[1]")
    rows = [row.split(",") for row in lines(ROWS, names=names).split("\n")]
    spans = [f"0 days 00:00:{float(row[0]):09.6f}" for row in rows[1:-1]]
    text = "\n".join(
        ",".join(row) for row in [rows[0], *([span, *row[1:]] for span, row in zip(spans, rows[1:], strict=False))]
    )
    are_right(imported(tmp_path, {"run.csv": text})[0])


def test_units_in_a_block_of_json_are_those_of_the_columns(tmp_path):
    rows = [{"t": 1000 * r[0], "depth": 1000 * r[1], "c0": r[2], "c1": r[3]} for r in ROWS.tolist()]
    units = {"t": "ms", "depth": "um", "c0": "pF", "c1": "pF"}
    are_right(imported(tmp_path, {"run.json": json.dumps({"units": units, "samples": rows})})[0])


def test_cells_of_matlab_are_refused_with_the_line_that_saves_them(tmp_path):
    cells = np.empty(3, object)
    cells[:] = [ROWS[:100], ROWS[:90], ROWS[:80]]
    savemat(tmp_path / "run.mat", {"trials": cells})
    with pytest.raises(TacdataError, match=r"writematrix\(trials\{k\}"):
        read_table(tmp_path / "run.mat")


def test_frames_of_a_matrix_are_a_row_each(tmp_path):
    frames = [
        f"FRAME {k} t={1000 * r[0]:.0f} ms z={r[1]:.4f} mm\n{r[2]:.4f} {r[3]:.4f}\n{r[3]:.4f} {r[2]:.4f}\n"
        for k, r in enumerate(ROWS)
    ]
    cut = "FRAME 9999 t=1 ms z=0.1 mm\n10.0 10.0\n"
    episodes, said = imported(tmp_path, {"run.txt": "# 2 x 2\n" + "\n".join([*frames[:7], cut, *frames[7:]])})
    are_right(episodes)
    assert episodes[0].taxels.counts.shape[1] == 4
    assert any("2 lines with another number of columns" in text for text in said)


def test_an_oscilloscope_states_its_interval_and_shifts_its_units(tmp_path):
    head = "Model,DPO4104\n\nSample Interval,0.05\nVertical Units,um,V,V\nProbe Attenuation,1,1,1\n\n"
    rows = lines(ROWS[:, 1:] * [1000, 1, 1], names=("CH1_a", "CH2", "CH3"))
    episodes, said = imported(tmp_path, {"T0007.CSV": head + rows})
    are_right(episodes)
    assert any("20 rows a second is stated" in text for text in map(str, said))


def test_the_increment_of_an_oscilloscope_is_its_interval(tmp_path):
    first, *rows = lines(np.column_stack([np.arange(len(ROWS)), ROWS[:, 1:]])).splitlines()
    head = f"{first.replace('t [s]', 'X')},Start,Increment\n{rows[0]},0,0.05\n"
    are_right(imported(tmp_path, {"run.csv": head + "".join(f"{row},,\n" for row in rows[1:])})[0])


def test_a_sheet_of_settings_states_the_rate(tmp_path):
    book = openpyxl.Workbook()
    for row in (("Name", "Value", "Unit"), ("Sampling rate", 20, "Hz"), ("Operator", "mh", None)):
        book.active.append(row)
    sheet = book.create_sheet("Data")
    for row in (NAMES[1:], *ROWS[:, 1:].tolist()):
        sheet.append(row)
    (tmp_path / "files").mkdir()
    book.save(tmp_path / "files" / "run.xlsx")
    are_right(of(tmp_path / "files")[0])


@pytest.mark.parametrize(
    ("names", "channels"),
    (
        (("t [s]", "Weg [mm]", "R1 [Ohm]", "R2 [Ohm]", "R3 [Ohm]", "Reading"), 3),
        (("t [s]", "present_position [mm]", "taxel_0", "taxel_1", "present_current", "goal_current"), 2),
        (("t [s]", "$POS_ACT.Z [mm]", "$ANIN[1]", "$ANIN[2]", "$AXIS_ACT.A1", "$POS_ACT.B"), 2),
    ),
)
def test_counters_joints_and_motors_are_no_channels(tmp_path, names, channels):
    last = np.column_stack([ROWS[:, 3], np.arange(len(ROWS))]) if channels == 3 else ROWS[:, [3, 2]]
    (tmp_path / "run.csv").write_text(lines(np.hstack([ROWS, last]), names=names))
    assert roles_of(read_table(tmp_path / "run.csv"))["channels"] == list(names[2 : 2 + channels])


@pytest.mark.parametrize(
    ("names", "asked"),
    [
        (("tip0_p_raw_hPa", "tip0_p_comp_hPa"), True),
        (("C1 [pF]", "Reading"), True),
        (("C1 [pF]", "C2 [pF]"), False),
        (("ch a", "ch b"), False),
    ],
)
def test_channels_of_several_kinds_are_asked_about(tmp_path, names, asked):
    text = lines(ROWS, names=("t [s]", "depth [mm]", *names))
    questions = imported(tmp_path, {"run.csv": text})[1]
    assert any("channels of 2 kinds" in str(text) for text in questions) is asked


def test_a_clock_without_a_unit_hides_no_question_about_the_height(tmp_path):
    rows = lines(ROWS * [1000, -1, 1, 1] + [0, 412, 0, 0], names=("timer", "z [mm]", "c0", "c1"))
    (tmp_path / "run.csv").write_text(rows)
    proposal = proposed_mapping(tmp_path, described(tmp_path)[0])
    assert all(
        any(words in text for text in proposal.questions) for words in ("no unit is given", "a machine's height")
    )
    assert proposal.mapping.trials.press_above
