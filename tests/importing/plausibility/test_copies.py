"""A row or a recording that is written twice counts once; equal readings of a quiet board count each."""

import numpy as np
import pytest
from sources import mapping, table, write

from tacdata.importing.imported_session import import_session
from tacdata.recording import read_session
from tacdata.recording.files.reader import read_episode


def imported(folder, path, **changes):
    made = import_session(folder, mapping(folder, path, **changes), folder / "session")
    return made, [read_episode(file) for file in read_session(made.folder).episodes]


@pytest.mark.parametrize(("form", "rows"), [("csv", slice(None)), ("npz", slice(40, 60)), ("parquet", slice(7, 8))])
def test_rows_that_are_written_twice_count_once(tmp_path, form, rows):
    original = table(presses=1)
    twice = np.sort(np.concatenate([np.arange(len(original)), np.arange(len(original))[rows]]))
    made, (episode,) = imported(tmp_path, write(tmp_path, form, original[twice]))
    assert len(episode.taxels.counts) == len(original)
    assert any(f"{len(twice) - len(original)} rows are copies" in note for note in made.notes)


def test_quiet_rows_of_a_coarse_clock_stay(tmp_path):
    rows = table(presses=1)
    rows[:, 0] = np.floor(rows[:, 0])
    rows[:, 2:] = np.rint(rows[:, 2:] * 10)
    made, (episode,) = imported(tmp_path, write(tmp_path, "csv", rows))
    assert len(episode.taxels.counts) == len(rows) and not any("copies" in note for note in made.notes)


def test_a_table_that_is_pasted_twice_counts_once(tmp_path):
    rows = table(presses=1)
    made, episodes = imported(tmp_path, write(tmp_path, "csv", np.concatenate([rows, rows])))
    assert len(episodes) == 1 and any("100 rows came before, with their time" in note for note in made.notes)


def test_recordings_that_differ_in_noise_count_each(tmp_path):
    rows = np.concatenate([table(presses=1), table(presses=1, seed=1)])
    made, episodes = imported(tmp_path, write(tmp_path, "csv", rows))
    assert len(episodes) == 2 and not any("the same" in note for note in made.notes)
