"""Where label files lie is known in one place."""

import re
from pathlib import Path

import pytest

from tacdata.labels import file_names

ROOT = Path(__file__).resolve().parents[2]
SPELLED = re.compile(r"""/ ?"labels"|\.stem\}\.parquet|"[^"\n]*\.failure\.json""")
"""A session's folder of labels, the label of a recording, or the reason why it has none, put together by hand."""


def test_an_episode_is_named_by_its_number_or_its_recording(tmp_path):
    labels = file_names.folder(tmp_path)
    recording = tmp_path / "episode-000007.mcap"
    assert file_names.label(labels, 7) == file_names.label(labels, recording) == labels / "episode-000007.parquet"
    failure = labels / "episode-000007.failure.json"
    assert file_names.failure(labels, 7) == file_names.failure(labels, recording) == failure
    assert file_names.store(labels) == tmp_path / "labels" / "store"


def test_files_are_found_by_number_and_others_are_not(tmp_path):
    labels = ("episode-000010.parquet", "episode-000002.parquet", "episode-000003.failure.json")
    others = (".episode-000004.parquet", "episode-5.parquet", "episode-000006.superseded", "index.sqlite")
    for name in labels + others:
        (tmp_path / name).touch()
    assert [*file_names.present(tmp_path)] == [2, 10]
    assert [*file_names.present(tmp_path, file_names.FAILURE)] == [3]


@pytest.mark.parametrize("room", ["tacdata", "label_farm", "training", "viewers"])
def test_no_other_file_spells_these_names(room):
    lines = {
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for path in (ROOT / room).rglob("*.py")
        if path != ROOT / "tacdata/labels/file_names.py"
        for line in path.read_text().splitlines()
        if SPELLED.search(line)
    }
    # What a user is told to read; other files: a failure in the store of solved presses, an exported table of targets.
    others = ("label_farm/store/", "tacdata/exporters/")
    assert {line for line in lines if "read {" not in line and not line.startswith(others)} == set()
