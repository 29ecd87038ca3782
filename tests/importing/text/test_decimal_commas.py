"""Decimal commas in all their company: read, or refused with the way to say it."""

from pathlib import Path

import numpy as np
import pytest
from running.in_process import tacdata

from tacdata.errors import FormatError
from tacdata.importing.formats.source_format import read_table
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.source_table import numbers

ROWS = [(k * 0.02, 20 + k * 0.01, k * 0.005) for k in range(60)]
HEADER = ("t [s]", "c [pF]", "depth [mm]")


def german(value: float) -> str:
    return f"{value:.3f}".replace(".", ",")


def written(path: Path, delimiter: str, quote: str = "") -> Path:
    lines = [delimiter.join(HEADER)]
    lines += [delimiter.join(f"{quote}{german(value)}{quote}" for value in row) for row in ROWS]
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize(("delimiter", "quote"), [(";", ""), ("\t", ""), (",", '"')])
def test_decimal_commas_are_read(tmp_path, delimiter, quote):
    table = read_table(written(tmp_path / "a.csv", delimiter, quote))
    for k, name in enumerate(HEADER):
        assert np.allclose(table.columns[name], np.array(ROWS)[:, k], atol=5e-4)


def test_commas_that_part_fields_and_decimals_are_refused(tmp_path):
    with pytest.raises(FormatError, match="3 names in the header, and 6 whole numbers a row") as error:
        read_table(written(tmp_path / "a.csv", ","))
    assert "semicolons" in error.value.remedy
    shown = tacdata("import", "a.csv", folder=tmp_path)
    assert shown.returncode == 3 and "are decimal points too" in shown.stderr


def test_what_the_mapping_says_wrongly_is_tried_the_other_way(tmp_path):
    with pytest.raises(FormatError, match=r"decimal '\.' as the mapping says") as error:
        read_table(written(tmp_path / "a.csv", ";"), ReadOptions(decimal="."))
    assert "delimiter: ';' and decimal: ','" in error.value.remedy
    (tmp_path / "b.csv").write_text("nothing\nof numbers\n")
    with pytest.raises(FormatError) as error:
        read_table(tmp_path / "b.csv", ReadOptions(decimal="."))
    assert "by which it can be read" not in error.value.remedy


@pytest.mark.parametrize("text", ["1.000,50", "1,000.50", "1 000.50", "12'345"])
def test_a_sign_between_thousands_is_named(tmp_path, text):
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["a;b", *(f"{text};{k}" for k in range(20))]))
    with pytest.raises(FormatError, match="a sign between thousands"):
        numbers(read_table(path), ["a"], [], "taxels")
