"""Files as strangers keep them: the outcome of each is the one that the table of the benchmark counts."""

import json
import sys
from pathlib import Path

import pytest

ROOM = Path(__file__).parents[2] / "benchmarks" / "measured_inputs"
OUTCOMES = {name: entry["outcome"] for name, entry in json.loads((ROOM / "outcomes.json").read_text()).items()}
QUICK = (
    "bag_of_ros_1",
    "clock_each",
    "clock_of_nmea",
    "cut_line_of_json",
    "damaged_content",
    "flatbuffer_in_mcap",
    "json_in_mcap",
    "killed_recorder",
    "lines_of_two_kinds",
    "log_time_of_conversion",
    "names_of_rows",
    "numbers_as_texts",
    "old_values",
    "packed_store",
    "pointer_of_lfs",
    "pose_of_ros",
    "position_on_change",
    "quantities_beside",
    "rows_sent_again",
    "slipped_encoder",
    "split_table",
    "stamps_of_zero",
    "structure_with_time",
    "texts_in_parquet",
    "three_machines",
    "unit_in_format",
    "units_by_cell",
    "zeros_first",
)
"""Inputs of kinds that were wrong once; the others are long."""
LONG = pytest.mark.long("benchmarks/measured_inputs", "tacdata/importing", reason="seventy imports of a second each")


@pytest.fixture(scope="module")
def bench():
    """Return the benchmark's script."""
    sys.path.insert(0, str(ROOM))
    import run

    return run


@pytest.mark.parametrize("name", [pytest.param(name, marks=() if name in QUICK else LONG) for name in sorted(OUTCOMES)])
def test_the_outcome_is_the_one_of_the_table(bench, tmp_path, name):
    outcome, deviations, said = bench.judged(bench.INPUTS[name], tmp_path / name)
    assert outcome == OUTCOMES[name], (deviations, said)


def test_no_outcome_is_wrong_in_silence_and_each_input_is_in_the_table(bench):
    assert set(OUTCOMES) == set(bench.INPUTS)
    assert set(OUTCOMES.values()) <= {"right", "refused", "asked"}
