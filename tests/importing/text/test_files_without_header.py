"""Files without a header: which column is the time."""

import numpy as np
import pytest

from tacdata.importing.formats.source_format import read_table
from tacdata.importing.proposing.description import described
from tacdata.importing.proposing.proposal import proposed_mapping
from tacdata.importing.proposing.roles import roles_of

ROWS = np.arange(40)
STRETCH = 1 + 0.01 * ROWS + 1e-5 * np.sin(7.0 * ROWS)
STRESS = 10 * np.log(STRETCH)


def time_of(path, columns):
    np.savetxt(path, np.column_stack(columns))
    return roles_of(read_table(path))["time"]


@pytest.mark.parametrize("place", range(3))
def test_a_way_in_alone_rises_throughout_but_less_evenly_than_a_clock(tmp_path, place):
    columns = [STRESS, STRETCH]
    columns.insert(place, 0.1 * (1 + ROWS))
    assert time_of(tmp_path / "run.txt", columns) == [str(place)]


def test_of_two_columns_that_rise_alike_evenly_the_first_one_is_the_time(tmp_path):
    assert time_of(tmp_path / "run.txt", [0.1 * ROWS, 0.02 * ROWS, STRESS]) == ["0"]


def test_what_was_taken_for_the_time_is_said(tmp_path):
    np.savetxt(tmp_path / "run.txt", np.column_stack([STRESS, STRETCH, 0.1 * ROWS]))
    found = proposed_mapping(tmp_path, described(tmp_path)[0])
    assert any("0, 1 are taken for channels, 2 as the time by its steps" in question for question in found.questions)


def test_a_comma_at_the_end_of_each_row_makes_no_channel(tmp_path):
    rows = [f"{0.1 * k:g}, {stress:.4f}," for k, stress in enumerate(STRESS)]
    (tmp_path / "run.csv").write_text("\n".join(["# Made by a program", "# data-1-x, data-1-y,", *rows]))
    table = read_table(tmp_path / "run.csv")
    assert len(table.columns) == 3 and len([name for names in roles_of(table).values() for name in names]) == 2
