"""Headers and cells as a person reads them, and shapes that need a word in the mapping."""

import numpy as np
import openpyxl
import pytest
from sources import NAMES, mapping, table, write

from tacdata.errors import FormatError
from tacdata.importing.expression import evaluated
from tacdata.importing.formats.source_format import read_table, tables_in
from tacdata.importing.imported_session import import_session
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.source_table import SourceTable
from tacdata.recording import read_session
from tacdata.recording.files.reader import read_episode


def imported(folder, path, **changes):
    """Return the import and its recordings."""
    made = import_session(folder, mapping(folder, path, **changes), folder / "session")
    return made, [read_episode(file) for file in read_session(made.folder).episodes]


def of(path, **time):
    """Return ``files`` of a mapping with further keys."""
    return {"run": {"path": path.name, "time": {"column": "t", "unit": "s"}, **time}}


@pytest.mark.parametrize(
    ("header", "names", "units"),
    [
        ("t,depth,c0,c1\ns,mm,pF,pF\n", ["t", "depth", "c0", "c1"], ["s", "mm", "pF", "pF"]),
        ("t,depth,c0,c1\ns,mm,pF,pF\nclock,stage,skin,skin\n", ["t", "depth", "c0", "c1"], ["s", "mm", "pF", "pF"]),
        ("t,stage,skin,\n,depth,c0,c1\ns,mm,pF,pF\n", ["t", "depth", "c0", "c1"], ["s", "mm", "pF", "pF"]),
        ("clock,stage,left,right\nt,z,signal,signal\n", ["t", "z", "left signal", "right signal"], []),
        ('t,depth,"c0\n[pF]",c1\n', ["t", "depth", "c0 [pF]", "c1"], ["pF"]),
    ],
)
def test_names_units_and_groups_are_told_apart(tmp_path, header, names, units):
    path = tmp_path / "run.csv"
    path.write_text(header + "\n".join(",".join(f"{v:.4f}" for v in row) for row in table()) + "\n")
    found = read_table(path)
    assert list(found.columns) == names and list(found.units.values()) == units


def workbook(folder, fill):
    """Save a workbook that a function fills; its path."""
    book = openpyxl.Workbook()
    fill(book, book.active)
    book.save(folder / "run.xlsx")
    return folder / "run.xlsx"


def test_a_merged_trial_number_holds_for_its_rows(tmp_path):
    rows = table(presses=2)
    half = len(rows) // 2

    def fill(_, sheet):
        sheet.append(["trial", *NAMES])
        for number, row in enumerate(rows.tolist()):
            sheet.append([1 + number // half if number % half == 0 else None, *row])
        sheet.merge_cells(f"A2:A{half + 1}")
        sheet.merge_cells(f"A{half + 2}:A{2 * half + 1}")

    made, episodes = imported(tmp_path, workbook(tmp_path, fill), trials={"column": "trial"})
    assert [len(e.taxels.counts) for e in episodes] == [half, half] and made.refused == ()


def test_a_label_in_the_first_row_of_a_block_holds_in_text_as_well(tmp_path):
    rows = table(presses=2)
    half = len(rows) // 2
    lines = [",".join(["trial", *NAMES])]
    lines += [f"{'AB'[k // half] if k % half == 0 else ''}," + ",".join(map(str, row)) for k, row in enumerate(rows)]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines) + "\n")
    _, episodes = imported(tmp_path, path, trials={"column": "trial"})
    assert [len(e.taxels.counts) for e in episodes] == [half, half]


def test_hidden_rows_and_sheets_are_left_out_and_named(tmp_path):
    rows = table(presses=2)

    def fill(book, sheet):
        sheet.title, sheet.sheet_state = "raw", "hidden"
        sheet.append(NAMES)
        sheet.append([0.0, 0.0, 1.0, 2.0])
        shown = book.create_sheet("run")
        for row in (NAMES, *rows.tolist()):
            shown.append(row)
        for number in range(102, len(rows) + 2):
            shown.row_dimensions[number].hidden = True
        book.active = 1

    path = workbook(tmp_path, fill)
    assert tables_in(path) == ("",)
    found = read_table(path)
    np.testing.assert_allclose(found.column("depth [mm]"), rows[:100, 1])
    assert any("100 hidden rows" in note for note in found.notes) and any(
        "raw (hidden)" in note for note in found.notes
    )


@pytest.mark.parametrize("form", ("npy", "csv", "mat", "json"))
def test_an_array_that_lies_on_its_side_is_turned(tmp_path, form):
    rows, path = table(), tmp_path / f"run.{form}"
    if form == "npy":
        np.save(path, rows.T)
    elif form == "csv":
        path.write_text("\n".join(",".join(f"{v:.6f}" for v in line) for line in rows.T) + "\n")
    elif form == "json":
        path.write_text(str(rows.T.tolist()))
    else:
        from scipy.io import savemat

        savemat(path, {"run": rows.T})
    changes = {
        "files": {"run": {"path": path.name, "time": {"column": 0, "unit": "s"}}},
        "taxels": {"file": "run", "columns": "2-3", "unit": "pF"},
        "position": {"file": "run", "depth": {"column": 1, "unit": "mm"}},
    }
    made, (episode,) = imported(tmp_path, path, **changes)
    np.testing.assert_allclose(episode.taxels.counts, rows[:, 2:], atol=1e-6)
    assert any("second axis is taken for time" in n or "line is taken for a column" in n for n in made.notes)


def test_variables_with_three_axes_are_trials(tmp_path):
    from scipy.io import savemat

    rows = table()
    savemat(tmp_path / "run.mat", {f"Trial{k}": rows[None, :, :] + 0.0 for k in (1, 2)})
    assert tables_in(tmp_path / "run.mat") == ("Trial1", "Trial2")


def test_an_expression_stands_for_a_column(tmp_path):
    rows = table()
    error = 0.01 * np.sin(np.arange(len(rows)))
    sources = np.column_stack([rows[:, 0], rows[:, 1] + error, error, rows[:, 2:]])
    names = ("t [s]", "set point [mm]", "position_error [mm]", "c0 [pF]", "c1 [pF]")
    path = write(tmp_path, "csv", sources, names)
    position = {"file": "run", "depth": {"expression": "`set point` - position_error"}}
    made, (episode,) = imported(tmp_path, path, position=position)
    np.testing.assert_allclose(episode.tip[:, 2], rows[:, 1], atol=2e-6)
    assert not any("has no unit" in note for note in made.notes)


def test_a_derived_column_gives_a_current_its_sign(tmp_path):
    rows = table()
    sign = np.where(np.arange(len(rows)) % 2, -1.0, 1.0)
    path = write(tmp_path, "npz", np.column_stack([rows, sign]), (*NAMES, "direction"))
    files = of(path, derived={"signed": "c0 * sign(direction)"})
    _, (episode,) = imported(tmp_path, path, files=files, taxels={"file": "run", "columns": "signed", "unit": "mA"})
    np.testing.assert_allclose(episode.taxels.counts[:, 0], rows[:, 2] * sign)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os')",
        "c0.T",
        "c0[0]",
        "[c0]",
        "lambda: 1",
        "c0 if c0 else 1",
        "'a'",
        "abs(c0, c0)",
        "",
        "((((",
        "True",
    ],
)
def test_an_expression_is_arithmetic_alone(tmp_path, text):
    source = SourceTable(tmp_path / "a.csv", {"c0": np.ones(3)})
    with pytest.raises(FormatError):
        evaluated(source, text, "position: depth")


def test_an_expression_without_a_value_is_missing_and_warns_of_nothing(tmp_path):
    source = SourceTable(tmp_path / "a.csv", {"c0": np.array([0.0, 1.0, -1.0])}, {"c0": "mm"})
    values, unit = evaluated(source, "sqrt(c0) / c0", "x")
    np.testing.assert_allclose(values, [np.nan, 1.0, np.nan])
    assert unit == "" and evaluated(source, "max(c0, 0) - 1", "x")[1] == "mm"


def test_parts_of_one_trial_are_joined_and_their_clock_is_continued(tmp_path):
    rows = table()
    for name, part in (("ramp", rows[:60]), ("hold", rows[60:])):
        part = part - [part[0, 0], 0, 0, 0]
        write(tmp_path, "csv", part).rename(tmp_path / f"{'1' if name == 'ramp' else '2'}_{name}.csv")
    path = tmp_path / "*.csv"
    made, (episode,) = imported(tmp_path, path, files=of(path, join="continued"))
    np.testing.assert_allclose(episode.taxels.counts, rows[:, 2:], atol=1e-6)
    np.testing.assert_allclose(np.diff(episode.taxels.sample_ns), 50_000_000, atol=1000)
    assert any("2 parts are below each other" in note for note in made.notes)


def test_sheets_of_one_trial_are_joined(tmp_path):
    rows = table()

    def fill(book, sheet):
        sheet.title = "Ramp"
        for name, part in (("Ramp", rows[:60]), ("Hold", rows[60:])):
            target = sheet if name == "Ramp" else book.create_sheet(name)
            for row in (NAMES, *part.tolist()):
                target.append(row)

    path = workbook(tmp_path, fill)
    _, (episode,) = imported(tmp_path, path, files=of(path, table=["Ramp", "Hold"]))
    np.testing.assert_allclose(episode.taxels.counts, rows[:, 2:])


def test_a_change_of_speed_begins_a_trial_and_a_zero_is_each_files_own(tmp_path):
    rows = table(presses=3)
    third = len(rows) // 3
    speed = np.repeat([1.0, 2.0, 1.0], third)
    lifted = rows + np.column_stack([np.zeros(len(rows)), np.repeat([3.0, 5.0, 7.0], third), *np.zeros((2, len(rows)))])
    path = write(tmp_path, "npz", np.column_stack([lifted, speed]), (*NAMES, "speed"))
    position = {"file": "run", "depth": {"column": "depth", "unit": "mm", "zero": "first"}}
    _, episodes = imported(tmp_path, path, trials={"change": "speed"}, position=position)
    assert [len(e.taxels.counts) for e in episodes] == [third] * 3
    assert [round(e.press.depth, 3) for e in episodes] == [1.2] * 3


def test_files_of_two_encodings_have_their_names(tmp_path):
    text = write(tmp_path, "csv", table()).read_text().replace("depth", "深さ")
    for encoding in ("utf-8", "shift_jis"):
        (tmp_path / f"{encoding}.csv").write_bytes(text.encode(encoding))
        found = read_table(tmp_path / f"{encoding}.csv", ReadOptions(encoding=["utf-8", "shift_jis"]))
        assert "深さ [mm]" in found.columns
