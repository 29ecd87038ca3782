"""Spellings of strangers' files: units in headers, words for no value, numbers and names in text files."""

import gzip
import re
from pathlib import Path

import numpy as np
import pytest
from foreign import mapping

from tacdata.errors import FormatError
from tacdata.importing.formats.source_format import read_table
from tacdata.importing.imported_session import import_session
from tacdata.importing.units import clock_unit, plain, split_unit
from tacdata.recording.files.reader import read_recording

ROWS, RATE = 120, 20.0
TIME, DEPTH = np.arange(ROWS) / RATE, 0.01 * np.arange(ROWS)


def text(header="t [s],disp [mm],cap0,cap1", scale=1.0, begin=0.0):
    rows = [f"{begin + t * scale:.15g},{d:.3f},{20 + d:.4f},{30 + d:.4f}" for t, d in zip(TIME, DEPTH, strict=True)]
    return "\n".join([header, *rows]) + "\n"


def brought(folder, data, **changes):
    (folder / "wide.csv").write_bytes(data if isinstance(data, bytes) else data.encode())
    clock = {"path": "wide.csv", "time": {"column": 0}, **changes.pop("file", {})}
    taxels = {"file": "data", "columns": [2, 3], "unit": "pF"}
    depth = {"file": "data", "depth": {"column": 1, "unit": "mm"}}
    usual = {"measured": None, "taxels": taxels, "position": depth}
    path = mapping(folder, version="1.2", files={"data": clock}, **{**usual, **changes})
    made = import_session(folder, path, Path(f"{folder}.session"))
    return made, read_recording(made.folder / "episode-000000.mcap").episode


def refusal(folder, data, **changes):
    with pytest.raises(FormatError) as caught:
        brought(folder, data, **changes)
    return caught.value


@pytest.mark.parametrize(
    ("header", "scale"),
    [
        ("t{ms}", 1e3),
        ("t<ms>", 1e3),
        ("t\uff08ms\uff09", 1e3),
        ("t\u3010ms\u3011", 1e3),
        ("t [ms] since start", 1e3),
        ("t.ms", 1e3),
        ("t-ms", 1e3),
        ("tMs", 1e3),
        ("t_ms_rel", 1e3),
        ("t in ms", 1e3),
        ("Zeit in Millisekunden", 1e3),
        ("temps en millisecondes", 1e3),
        ("\u65f6\u95f4(\u6beb\u79d2)", 1e3),
        ("ms", 1e3),
        ("millis", 1e3),
        ("millis()", 1e3),
        ("micros", 1e6),
        ("t [\u00b5s]", 1e6),
        ("t [\u03bcs]", 1e6),
        ("time_10ms", 1e2),
        ("t [s.]", 1),
        ("t [SEC]", 1),
        ("t [10^-3 s]", 1e3),
        ("t [x10 ms]", 1e2),
        ("t [1/20 s]", 20),
        ("t [Minutes]", 1 / 60),
    ],
)
def test_a_unit_is_understood_however_it_is_spelled(tmp_path, header, scale):
    _, episode = brought(tmp_path, text(f'"{header}",disp,cap0,cap1', scale))
    np.testing.assert_allclose(np.diff(episode.taxels.sample_ns), 50_000_000, atol=20_000)


@pytest.mark.parametrize("unit", ["ticks", "Takte", "weeks", "hh:mm:ss", "ms/10", "?", "mm", "m"])
def test_a_unit_that_is_not_understood_is_named_as_it_stands(tmp_path, unit):
    error = refusal(tmp_path, text(f"t [{unit}],disp,cap0,cap1"))
    assert f"unit {unit!r}" in error.given and error.allowed == "s, ms, us, ns, min, h, d"


@pytest.mark.parametrize(
    ("scale", "begin", "given", "unit"),
    [
        (1e3, 0, "a row comes every 50 s", "unit: ms or s"),
        (1e6, 0, "every 50000 s", "unit: us or s"),
        (20, 0, "every 1 s", "of a counter of rows"),
        (1 / 3600, 0, "7.2e+04 Hz", "min or h or s"),
        (20 / 86_400, 46_000.4, "8.64e+04 Hz", "unit: excel or s"),
        (2000 / 86_400, 46_000.4, "864 Hz", "unit: excel or s"),
        (20 / 86_400, 740_311.4, "8.64e+04 Hz", "unit: datenum or s"),
    ],
)
def test_times_without_a_unit_that_cannot_be_seconds_are_asked_for(tmp_path, scale, begin, given, unit):
    error = refusal(tmp_path, text("t,disp,cap0,cap1", scale, begin))
    assert "no unit is given" in error.given and given in error.given and unit in error.remedy


def test_a_unit_that_is_given_wrongly_is_held_against_the_rate(tmp_path):
    error = refusal(tmp_path, text("t [s],disp,cap0,cap1", 1 / 86_400, 46_000.4))
    assert "in s the rows come at 1.73e+06 Hz" in error.given and "excel" in error.remedy


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("Fz [N]", ("Fz", "N")),
        ("cap[3]", ("cap", "3")),
        ("force.min", ("force.min", "")),
        ("plug-in", ("plug-in", "")),
        ("depth_d", ("depth_d", "")),
        ("Fz / N", ("Fz", "N")),
        ("disp {um} raw", ("disp raw", "um")),
        ("c0", ("c0", "")),
    ],
)
def test_a_name_is_parted_from_its_unit(name, parts):
    assert split_unit(name) == parts


@pytest.mark.parametrize(("unit", "size"), [("ft", 304.8), ("thou", 0.0254), ("in", 25.4), ("feet", 304.8), ("m", 1e3)])
def test_lengths_of_other_units_are_converted(tmp_path, unit, size):
    rows = [f"{t:g},{d / size:.9g},{20 + d:.4f},{30 + d:.4f}" for t, d in zip(TIME, DEPTH, strict=True)]
    text_in = "\n".join([f"t [s],disp [{unit}],cap0,cap1", *rows])
    made, episode = brought(tmp_path, text_in, position={"file": "data", "depth": {"column": 1}})
    assert episode.press.depth == pytest.approx(DEPTH.max(), rel=1e-3) and "taken in mm" not in " ".join(made.notes)


def test_a_position_without_a_unit_is_said_to_be_taken_in_mm(tmp_path):
    made, _ = brought(tmp_path, text("t [s],disp,cap0,cap1"), position={"file": "data", "depth": {"column": 1}})
    wanted = "position: disp has no unit and is taken in mm; else give unit under position/depth in the mapping"
    assert wanted in made.notes
    brought_m = tmp_path / "metres"
    brought_m.mkdir()
    made, _ = brought(brought_m, text("t [s],disp,cap0,cap1"))
    assert not [note for note in made.notes if "taken in mm" in note], "the mapping gives a unit"


def test_minutes_and_seconds_as_excel_shows_them(tmp_path):
    rows = [
        f"{int(t // 60)}:{t % 60:04.1f},{d:.3f},{20 + d:.4f},{30 + d:.4f}" for t, d in zip(2 * TIME, DEPTH, strict=True)
    ]
    _, episode = brought(tmp_path, "\n".join(["t,disp,cap0,cap1", *rows]))
    np.testing.assert_allclose(np.diff(episode.taxels.sample_ns), 100_000_000, atol=20_000)


def test_two_units_in_a_clocks_name_are_none():
    assert clock_unit("time_sec_and_ms") == ""


@pytest.mark.parametrize(
    "word",
    [
        "-nan(ind)",
        "1.#QNAN",
        "-1.#IND",
        "1.#INF",
        "<NA>",
        "NaT",
        "(null)",
        "n.a.",
        "#NV",
        "inf",
        "Err:502",
        "*****",
        "-1.#IND00",
    ],
)
def test_words_for_no_value_stand_in_any_row_the_first_too(tmp_path, word):
    lines = text().splitlines()
    lines[1:] = [
        line.replace(f"{20 + d:.4f}", word) if k % 7 == 0 else line
        for k, (line, d) in enumerate(zip(lines[1:], DEPTH, strict=True))
    ]
    _, episode = brought(tmp_path, "\n".join(lines))
    assert np.isnan(episode.taxels.counts).sum() == 18 and len(episode.taxels.counts) == ROWS


@pytest.mark.parametrize("word", ["OL", "overflow", "missing"])
def test_an_unknown_word_is_named_with_its_column_and_row(tmp_path, word):
    error = refusal(tmp_path, re.sub(r",20\.0\d+", f",{word}", text()))
    assert f"column cap0, row 1 of the data: {word!r}" in error.given
    assert "missing in the mapping" in error.remedy


@pytest.mark.parametrize(
    ("change", "note"),
    [
        (lambda t: ("note\x85 by us\n" + t).encode("latin-1"), "Latin-1"),
        (lambda t: t.encode("utf-32"), ""),
        (lambda t: t.encode() + bytes(5000), "5000 zero bytes"),
        (lambda t: t.replace("cap0", '"cap0\n[pF]"'), ""),
        (lambda t: t.replace("cap1", "cap0", 1), "later columns are called cap0'"),
        (lambda t: t.replace("0.5,0.100", "t [s],disp [mm],cap0,cap1\n0.5,0.100"), "1 repeated header lines"),
        (lambda t: "".join(f"{k}: info\n" for k in range(700)) + t, ""),
        (lambda t: "operator,Jane,,\n" + t, ""),
        (lambda t: t.replace("\n", "\r"), ""),
    ],
    ids=["x85", "utf-32", "zeros", "line break", "twice", "header again", "700 lines", "two heads", "cr"],
)
def test_every_row_of_a_text_file_is_imported_or_counted(tmp_path, change, note):
    made, episode = brought(tmp_path, change(text()))
    assert len(episode.taxels.counts) == ROWS and not np.isnan(episode.taxels.counts).any()
    np.testing.assert_allclose(episode.taxels.counts[:, 0], 20 + DEPTH, atol=1e-4)
    assert note in " ".join(made.notes)


def test_a_file_that_is_called_compressed_and_is_not_is_to_be_renamed(tmp_path):
    (tmp_path / "a.csv.gz").write_text(text())
    with pytest.raises(FormatError, match="and is not compressed") as caught:
        read_table(tmp_path / "a.csv.gz")
    assert caught.value.remedy == "rename it to a.csv"


@pytest.mark.parametrize(
    ("data", "given"),
    [
        (b"", "is empty"),
        (text().encode("utf-16-le"), "UTF-16 by all appearance"),
        (text()[:500].encode() + bytes(99) + text()[500:].encode(), "99 zero bytes, the first in line"),
        (gzip.compress(text().encode()), "is gzip"),
        (b"PK\x03\x04" + bytes(99), "is a zip archive"),
        ("\n".join(text().splitlines()[:2]), "fewer than two rows"),
    ],
    ids=["empty", "utf-16", "zeros", "gzip", "zip", "one row"],
)
def test_what_is_no_table_is_called_what_it_is(tmp_path, data, given):
    assert given in refusal(tmp_path, data).given


def stretched(header, unit):
    """Return what a strip gives that is stretched by 240 of its unit."""
    rows = [f"{t:.15g},{200 * d:.3f},{20 + d:.4f},{30 + d:.4f}" for t, d in zip(TIME, DEPTH, strict=True)]
    return {
        "data": "\n".join([f"t [s],{header},cap0,cap1", *rows]),
        "position": {"file": "data", "depth": {"column": 1} | unit},
    }


@pytest.mark.parametrize(("header", "unit"), [("disp [mm]", {}), ("disp", {"unit": "mm"})])
def test_a_long_stroke_is_believed_where_its_unit_is_stated(tmp_path, header, unit):
    _, episode = brought(tmp_path, **stretched(header, unit))
    assert episode.press.depth == pytest.approx(238)


def test_a_long_stroke_without_a_unit_is_asked_for_it_and_none_is_of_metres(tmp_path):
    error = refusal(tmp_path, **stretched("disp", {}))
    assert "238 mm deep" in error.given and error.allowed == "presses of at most 100 mm"
    error = refusal(tmp_path, **stretched("disp [cm]", {}))
    assert error.allowed == "presses of at most 1000 mm"


@pytest.mark.parametrize(
    ("header", "unit", "scale"),
    [
        ("Weg in Millimetern", "mm", 1.0),
        ("Weg in Mikrometern", "um", 1000.0),
        ("\u4f4d\u79fb(\u6beb\u7c73)", "mm", 1.0),
        ("d\u00e9placement en millim\u00e8tres", "mm", 1.0),
        ("disp in in", "in", 1 / 25.4),
    ],
)
def test_a_length_is_read_in_the_units_of_other_languages(tmp_path, header, unit, scale):
    assert plain(split_unit(header)[1]) == unit
    rows = [f"{t:.3f},{d * scale:.9g},{20 + d:.4f},{30 + d:.4f}" for t, d in zip(TIME, DEPTH, strict=True)]
    data = "\n".join([f"t [s],{header},cap0,cap1", *rows]) + "\n"
    _, episode = brought(tmp_path, data, position={"file": "data", "depth": {"column": 1}})
    np.testing.assert_allclose(episode.tip[:, 2], DEPTH, atol=1e-6)


@pytest.mark.parametrize("name", ("V_IN", "made in house", "time in air", "in", "depth in the skin"))
def test_a_name_with_in_has_no_unit(name):
    assert split_unit(name) == (name, "")


@pytest.mark.parametrize("given", (None, "um", "mm", "cm"))
def test_a_file_whose_name_and_line_of_units_differ_is_decided_by_the_mapping(tmp_path, given):
    data = text("t,disp [mm],cap0,cap1\ns,um,pF,pF")
    position = {"file": "data", "depth": {"column": 1, **({"unit": given} if given else {})}}
    if given in ("um", "mm"):
        _, episode = brought(tmp_path, data, position=position)
        np.testing.assert_allclose(episode.tip[:, 2], DEPTH * (1.0 if given == "mm" else 1e-3), atol=1e-6)
        return
    error = refusal(tmp_path, data, position=position)
    assert "disp [mm]" in error.given and ("um" in error.given)


def loads(units):
    """A table with two forces in units of their own, 1 and 2 N at 1 mm."""
    scales = {"N": 1.0, "mN": 1000.0, "kg": 1 / 9.80665, "Nmm": 1.0}
    rows = [
        f"{t:.3f},{d:.4f},{20 + d:.4f},{d * scales[units[0]]:.6f},{2 * d * scales[units[1]]:.6f}"
        for t, d in zip(TIME, DEPTH, strict=True)
    ]
    return "\n".join([f"t [s],disp [mm],cap0,fx [{units[0]}],fz [{units[1]}]", *rows]) + "\n"


@pytest.mark.parametrize("units", [("N", "mN"), ("kg", "N"), ("mN", "kg")])
def test_forces_of_different_units_are_each_converted(tmp_path, units):
    force = {"force": {"file": "data", "columns": [3, 4]}}
    _, episode = brought(tmp_path, loads(units), taxels={"file": "data", "columns": [2]}, measured=force)
    (measured,) = episode.measured
    np.testing.assert_allclose(measured.values, DEPTH[:, None] * [1.0, 2.0], atol=2e-5)
    assert measured.unit == "N"


def test_a_moment_beside_a_force_keeps_its_unit_and_is_told(tmp_path):
    force = {"wrench": {"file": "data", "columns": [3, 4]}}
    made, _ = brought(tmp_path, loads(("N", "Nmm")), taxels={"file": "data", "columns": [2]}, measured=force)
    assert "measured: wrench: its columns have the units N, Nmm, and each keeps its own" in made.notes


@pytest.mark.parametrize("given", ("N", "mN"))
def test_a_unit_of_a_force_that_the_file_contradicts_is_refused(tmp_path, given):
    force = {"force": {"file": "data", "columns": [3, 4], "unit": given}}
    error = refusal(tmp_path, loads(("kg", "kg")), taxels={"file": "data", "columns": [2]}, measured=force)
    assert f"states kg for fx [kg], and the mapping {given}" in error.given


@pytest.mark.parametrize(("stated", "given"), [("pF", "nF"), ("mV", "V"), ("kPa", "Pa"), ("uT", "mT")])
def test_a_prefix_of_the_channels_unit_that_the_file_contradicts_is_refused(tmp_path, stated, given):
    header = f"t [s],disp [mm],cap0 [{stated}],cap1 [{stated}]"
    error = refusal(tmp_path, text(header), taxels={"file": "data", "columns": [2, 3], "unit": given})
    assert f"states {stated} for cap0" in error.given
    made, _ = brought(tmp_path, text(header), taxels={"file": "data", "columns": [2, 3], "unit": stated})
    assert made.recordings == 1


@pytest.mark.parametrize(("first", "second"), [("nF", "pF"), ("V", "mV"), ("counts", "V")])
def test_channels_of_different_units_are_told(tmp_path, first, second):
    data = text(f"t [s],disp [mm],cap0 [{first}],cap1 [{second}]")
    made, _ = brought(tmp_path, data, taxels={"file": "data", "columns": [2, 3]})
    assert f"taxels: its columns have the units {first}, {second}, and each keeps its own" in made.notes


@pytest.mark.parametrize("breaks", (1, 2))
def test_line_breaks_in_the_quoted_names_of_all_columns_are_joined(tmp_path, breaks):
    names = [f'"{name}{chr(10) * breaks}[{unit}]"' for name, unit in zip("tdab", ("s", "mm", "pF", "pF"), strict=True)]
    lines = text().split("\n")
    path = tmp_path / "run.csv"
    path.write_text("\n".join(["\t".join(names), *(line.replace(",", "\t") for line in lines[1:])]))
    table = read_table(path)
    assert [split_unit(name)[0] for name in table.columns] == ["t", "d", "a", "b"] and table.rows == ROWS


@pytest.mark.parametrize(("unit", "doubt"), [("um", True), ("mm", False), ("nm", True)])
def test_a_path_too_short_for_a_tactile_sensor_is_asked_about(tmp_path, unit, doubt):
    path = 1.2 * np.sin(np.pi * TIME / TIME[-1]) ** 2
    rows = [f"{t:.3f},{d:.5f},{20 + d:.4f},{30 + d:.4f}" for t, d in zip(TIME, path, strict=True)]
    data = "\n".join([f"t [s],disp [{unit}],cap0,cap1", *rows]) + "\n"
    made, _ = brought(tmp_path, data, position={"file": "data", "depth": {"column": 1}})
    assert any("is its unit another?" in note for note in made.notes) == doubt
