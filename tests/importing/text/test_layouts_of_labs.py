"""Texts of loggers and testing machines: remarks behind rows, headers among them, dates in words, archives."""

import os

import numpy as np
import pytest
from sources import NAMES, mapping, table

from tacdata.errors import FormatError, TacdataError, UsageError
from tacdata.importing.formats.source_format import read_table
from tacdata.importing.imported_session import import_session
from tacdata.importing.mapping import SourceClock
from tacdata.importing.proposing.description import described
from tacdata.importing.proposing.roles import roles_of
from tacdata.importing.source_files import files_below
from tacdata.importing.source_table import SourceTable
from tacdata.importing.times import times

ROWS = table(presses=1)


def lines(rows, between=","):
    return [between.join(f"{value:.5f}" for value in row) for row in rows]


def written(folder, *texts, name="run.csv"):
    path = folder / name
    path.write_text("\n".join(texts) + "\n", encoding="utf-8")
    return path


def test_a_remark_behind_the_first_row_makes_no_header_of_it(tmp_path):
    body = lines(ROWS, "\t")
    head = ["***End_of_Header***", "X_Value\tposition\tc0\tc1\tComment"]
    found = read_table(written(tmp_path, *head, body[0] + "\tstart", *body[1:], name="run.lvm"))
    assert list(found.columns) == ["X_Value", "position", "c0", "c1"] and found.rows == len(ROWS) - 1
    assert any("1 lines with another number of columns" in note for note in found.notes)


@pytest.mark.parametrize(("step", "rate"), [("0.050000", 20.0), ("5.0E-2", 20.0), ("0,002", 500.0)])
def test_the_step_of_a_labview_file_is_its_rate(tmp_path, step, rate):
    head = ["Channels\t3", f"Delta_X\t{step}\t{step}", "***End_of_Header***", "position\tc0\tc1"]
    assert read_table(written(tmp_path, *head, *lines(ROWS[:, 1:], "\t"), name="run.lvm")).rate == pytest.approx(rate)


@pytest.mark.parametrize(
    "second", ["t [s],Force [N],c0 [pF],c1 [pF]", "t [ms],depth [um],c0 [pF],c1 [pF]", "t,c0,depth,c1"]
)
def test_the_header_of_another_table_is_refused(tmp_path, second):
    path = written(tmp_path, ",".join(NAMES), *lines(ROWS), "", second, *lines(ROWS))
    with pytest.raises(FormatError, match="the header of another table") as caught:
        read_table(path)
    assert "a file of its own" in caught.value.remedy


@pytest.mark.parametrize(
    "again", [["t,depth,c0,c1", "s,mm,pF,pF"], ["s,mm,pF,pF"], ["t,depth,c0,c1", "(s),(mm),(pF),(pF)"]]
)
def test_a_header_that_repeats_is_left_out_and_counted(tmp_path, again):
    body = lines(ROWS)
    found = read_table(written(tmp_path, "t,depth,c0,c1", "s,mm,pF,pF", *body[:50], *again, *body[50:]))
    assert found.rows == len(ROWS) and all(np.isfinite(values).all() for values in found.columns.values())
    counted = sum(int(note.split(": ")[1].split()[0]) for note in (*found.notes, *found.doubts) if "repeated" in note)
    assert counted == len(again)


def test_a_word_of_the_operator_among_the_rows_is_no_header(tmp_path):
    body = lines(table(presses=3))
    found = read_table(written(tmp_path, ",".join(NAMES), *body[:50], "pause,pause,pause,pause", *body[50:]))
    assert found.rows == len(body) + 1 and any("hold no number" in doubt for doubt in found.doubts)


def test_a_typographic_minus_is_one(tmp_path):
    rows = ROWS - [0, 0.5, 0, 0]
    body = [line.replace("-", "\u2212") for line in lines(rows)]
    assert read_table(written(tmp_path, ",".join(NAMES), *body)).columns["depth [mm]"].min() == -0.5


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("29. März 2026 12:00:0{}.5", 1774785600.5),
        ("29 août 2026 12:00:0{}", 1788004800.0),
        ("29-mar.-2026 12:00:0{}.250", 1774785600.25),
        ("29/dic/2026 12:00:0{}", 1798545600.0),
        ("29 June 2026 12:00:0{}", 1782734400.0),
        ("Sun Mar 29 12:00:0{}.5 2026", 1774785600.5),
    ],
)
def test_months_are_read_in_several_languages(tmp_path, text, seconds):
    values = np.array([text.format(k) for k in range(5)], dtype=object)
    found, zero = times(SourceTable(tmp_path / "run.csv", {"t": values}), SourceClock(column="t"), "time")
    assert zero == "unix" and np.allclose(found / 1e9 - seconds, np.arange(5), atol=1e-6)


@pytest.mark.parametrize(
    ("texts", "seconds"),
    [
        (["23:59:59.5", "24:00:00.5", "25:00:01"], [86399.5, 86400.5, 90001]),
        (["99:59:59", "100:00:00.5"], [359999, 360000.5]),
        (["-00:00:01,5", "-00:00:00,5", "00:00:00,5"], [-1.5, -0.5, 0.5]),
        (["23:59:59.5", "00:00:00.5"], [86399.5, 86400.5]),
    ],
)
def test_durations_go_on_and_times_of_day_turn(tmp_path, texts, seconds):
    found, _ = times(
        SourceTable(tmp_path / "run.csv", {"t": np.array(texts, dtype=object)}), SourceClock(column="t"), "time"
    )
    assert np.allclose(found / 1e9, seconds)


def test_a_time_with_signs_between_thousands_is_named(tmp_path):
    values = np.array(["0,00", "950,00", "1.000,00"], dtype=object)
    with pytest.raises(FormatError, match="a sign between its thousands"):
        times(SourceTable(tmp_path / "run.csv", {"t": values}), SourceClock(column="t"), "time")


@pytest.mark.parametrize("ending", (".zip", ".csv.bz2", ".7z", ".tar"))
def test_an_archive_is_to_be_unpacked(tmp_path, ending):
    (tmp_path / f"run{ending}").write_bytes(b"PK\x03\x04")
    with pytest.raises(UsageError) as caught:
        described(tmp_path)
    assert "unpack it" in caught.value.remedy


@pytest.mark.parametrize("text", ("<html><body><table><tr><td>1</td></tr></table>", '<?xml version="1.0"?><Workbook>'))
def test_markup_with_the_ending_of_a_workbook_is_named(tmp_path, text):
    with pytest.raises(TacdataError) as caught:
        read_table(written(tmp_path, text, name="run.xls"))
    assert "save it as .xlsx" in caught.value.remedy


def test_a_folder_that_links_to_itself_is_read_once(tmp_path):
    path = written(tmp_path, ",".join(NAMES), *lines(ROWS))
    (tmp_path / "inner").mkdir()
    os.symlink(tmp_path, tmp_path / "inner" / "loop")
    assert files_below(tmp_path) == [path]
    assert import_session(tmp_path, mapping(tmp_path, path), tmp_path.parent / "session").recordings == 1


@pytest.mark.parametrize(
    ("names", "depth"),
    [
        (("target_mm", "actual_mm"), "actual_mm"),
        (("command [mm]", "stage [mm]"), "stage [mm]"),
        (("Sollwert mm", "Istwert mm"), "Istwert mm"),
        (("encoder [mm]",), "encoder [mm]"),
        (("axis1 [mm]",), "axis1 [mm]"),
    ],
)
def test_a_measured_length_is_the_depth_before_a_commanded_one(tmp_path, names, depth):
    columns = {"t [s]": ROWS[:, 0], **dict.fromkeys(names, ROWS[:, 1]), "c0 [pF]": ROWS[:, 2]}
    found = roles_of(SourceTable(tmp_path / "run.csv", columns))
    assert found["depth"][0] == depth and "angle" not in found and "joint" not in found
