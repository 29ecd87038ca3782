"""The verbs that edit datasets keep sensors, records and flags; lerobot does the editing, without a network."""

from pathlib import Path

import numpy as np
import press_example as example
import pytest
from running.in_process import tacdata

from tacdata.commands.dataset.command import numbers
from tacdata.dataset import edit, pack, read_dataset, restore
from tacdata.dataset.flags import flagged_episodes, set_flag
from tacdata.dataset.format import features, metadata
from tacdata.dataset.notes import add_note, carry_notes, notes_path, read_notes
from tacdata.errors import FormatError, UsageError

FRAMES = 12


@pytest.fixture(scope="module")
def packed(tmp_path_factory) -> Path:
    root = tmp_path_factory.mktemp("edit") / "whole"
    pack([example.episode(n, FRAMES) for n in range(4)], example.label, root)
    return root


def recorded(root: Path) -> list[int]:
    """The press of each episode; its readings are checked on the way."""
    data = read_dataset(root)
    for entry in data.episodes:
        raw = data[features.RAW][entry.start : entry.stop]
        assert np.array_equal(raw, example.episode(entry.press.index, FRAMES).taxels.counts.astype(np.float32))
    return [entry.press.index for entry in data.episodes]


def test_delete_split_and_merge_keep_what_lerobot_drops(packed: Path, tmp_path: Path) -> None:
    dropped = read_dataset(packed).episodes[2].record
    set_flag(packed, dropped.recording, dropped.recording_file, "the finger slipped")
    assert edit.delete(packed, [1, 1], tmp_path / "fewer") == []
    assert recorded(tmp_path / "fewer") == [0, 2, 3]
    assert flagged_episodes(read_dataset(tmp_path / "fewer")) == {1: "the finger slipped"}, "numbered anew"
    assert edit.split(packed, {"a": [3, 0], "b": [2]}, tmp_path / "parts") == {"a": [], "b": []}
    assert recorded(tmp_path / "parts/a") == [0, 3] and recorded(tmp_path / "parts/b") == [2]
    assert edit.merge([tmp_path / "parts/b", tmp_path / "parts/a"], tmp_path / "merged") == []
    assert recorded(tmp_path / "merged") == [2, 0, 3]
    assert flagged_episodes(read_dataset(tmp_path / "merged")) == {0: "the finger slipped"}
    assert recorded(packed) == [0, 1, 2, 3], "the source stays as it is"
    assert not list(tmp_path.glob(".*")), "nothing unfinished is left"


def test_notes_on_stretches_go_where_their_recording_goes(packed: Path, tmp_path: Path) -> None:
    for number in (1, 2):
        record = read_dataset(packed).episodes[number].record
        add_note(packed, record.recording, record.recording_file, 0.1, 0.2, f"of {number}")
    edit.delete(packed, [1], tmp_path / "fewer")
    assert [note.text for note in read_notes(tmp_path / "fewer")] == ["of 2"]
    assert notes_path(tmp_path / "fewer") == tmp_path / "fewer" / "meta" / "tacdata_notes.json"
    assert carry_notes(packed, tmp_path / "fewer") == 0, "never twice"
    notes_path(packed).unlink()


@pytest.mark.parametrize(
    ("edited", "words"),
    [
        (lambda d, out: edit.delete(d, [4], out), "no episode 4"),
        (lambda d, out: edit.delete(d, [0, 1, 2, 3], out), "all 4 episodes"),
        (lambda d, out: edit.split(d, {"a": [0, 1], "b": [1]}, out), "episode 1 in the parts a and b"),
        (lambda d, out: edit.split(d, {"a": []}, out), "part 'a' with 0 episodes"),
        (lambda d, out: edit.split(d, {"../a": [0]}, out), r"part '\.\./a'"),
        (lambda d, out: edit.merge([d, d], out), "both hold episode-000000.mcap"),
        (lambda d, out: edit.merge([d], out), "1 datasets to merge"),
        (lambda d, out: edit.delete(d, [0], d), "exists"),
    ],
)
def test_what_cannot_be_meant_is_refused_before_anything_is_written(
    packed: Path, tmp_path: Path, edited, words
) -> None:
    with pytest.raises(UsageError, match=words):
        edited(packed, tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_what_lerobot_refuses_is_said_in_words(packed: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    pack([example.episode(8, FRAMES)], example.label, other)
    info = other / "meta/info.json"
    info.write_text(info.read_text().replace('"fps": 30', '"fps": 25'))
    with pytest.raises(FormatError, match=r"lerobot cannot write .*merged.*fps"):
        edit.merge([packed, other], tmp_path / "merged")
    assert [path.name for path in tmp_path.iterdir()] == ["other"]


def test_one_source_may_be_plain_text(packed: Path, tmp_path: Path) -> None:
    edit.delete(packed, [0], tmp_path / "fewer")
    (tmp_path / "fewer" / metadata.MAIN).unlink()
    (tmp_path / "fewer" / metadata.RECORDS).unlink()
    assert restore(str(tmp_path / "fewer"), str(packed)) == []
    assert recorded(tmp_path / "fewer") == [1, 2, 3]
    with pytest.raises(UsageError, match="no folder /nowhere"):
        restore(tmp_path / "fewer", "/nowhere")


def test_numbers_of_episodes_are_read_as_they_are_typed() -> None:
    assert numbers("0-2, 7") == [0, 1, 2, 7]
    for wrong in ("", "3-1", "a", "1,,2", "-1"):
        with pytest.raises(UsageError, match="episodes"):
            numbers(wrong)


def test_the_verbs_print_what_they_made(packed: Path, tmp_path: Path, monkeypatch) -> None:
    def typed(*words: str) -> str:
        done = tacdata("dataset", *words)
        assert done.returncode == 0, done.stderr
        return done.stdout

    monkeypatch.chdir(tmp_path)
    assert "without 1 episode;" in typed("delete", str(packed), "--episodes", "1", "--out", "fewer")
    (tmp_path / "fewer" / metadata.MAIN).unlink()
    assert "sensors and units are back" in typed("restore", "fewer", str(packed))
    shown = typed("split", "fewer", "--part", "a=0-1", "--part", "b=2", "--out", "parts")
    assert "parts/a: 2 episodes" in shown and "parts/b: 1 episode\n" in shown
    assert "2 datasets in one" in typed("merge", "parts/a", "parts/b", "--out", "again")
    assert recorded(tmp_path / "again") == [0, 2, 3]
