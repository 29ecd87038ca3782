"""`tacdata pack`: a session's files in, a dataset or words out."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import press_example as example
import pytest

from tacdata import cli, documents, provenance
from tacdata.dataset import read_dataset
from tacdata.dataset.flags import carry_flags, flagged_episodes, read_flags, set_flag
from tacdata.labels import write_label
from tacdata.recording.files import reader


class RecordedSession(NamedTuple):
    """A session whose episodes come from memory."""

    episodes: tuple[Path, ...]
    unfinished: tuple[Path, ...]
    labels: Path

    def __iter__(self):
        return (reader.read_episode(path) for path in self.episodes)


@pytest.fixture
def recorded(tmp_path: Path, monkeypatch) -> Path:
    """A session of three presses, the last without label; the recordings themselves are stood in for."""
    folder = tmp_path / "session"
    folder.mkdir()
    episodes = {}
    for number in range(3):
        path = folder / f"episode-{number:06d}.mcap"
        path.write_bytes(b"recording %d" % number)
        episodes[path] = replace(example.episode(number), path=path)
        if number < 2:
            write_label(folder / "labels" / f"{path.stem}.parquet", example.label(episodes[path]))
    failure = {
        "version": "1.0",
        "kind": "solve",
        "reason": "no equilibrium at 1.2 mm",
        "failed_at": "2026-01-01",
        "code_version": "0",
    }
    documents.write(folder / "labels" / "episode-000002.failure.json", failure, "label_failure")
    found = RecordedSession(tuple(episodes), (folder / "episode-000003.partial.mcap",), folder / "labels")
    monkeypatch.setattr("tacdata.pipeline.pack.read_session", lambda _: found)
    monkeypatch.setattr(reader, "read_episode", episodes.__getitem__)
    return folder


def run(monkeypatch, *arguments) -> int:
    monkeypatch.setattr(sys, "argv", ["tacdata", "pack", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    return int(stop.value.code or 0)


def test_a_session_becomes_a_dataset(recorded: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    assert run(monkeypatch, recorded, "--out", tmp_path / "d") == 0
    said = capsys.readouterr().out
    assert "episode-000000.mcap  packed" in said
    assert "episode-000002.mcap  left out: it has no label" in said
    assert "no equilibrium at 1.2 mm" in said
    assert "episode-000003.partial.mcap  left out" in said
    assert "2 episodes, 40 frames" in said
    dataset = read_dataset(tmp_path / "d")
    first = recorded / "episode-000000.mcap"
    assert dataset.episodes[0].record.recording == provenance.file_hash(first)
    assert run(monkeypatch, recorded, "--out", tmp_path / "d") == 2
    assert "exists" in capsys.readouterr().err
    assert run(monkeypatch, recorded, "--out", tmp_path / "d", "--append") == 0
    assert "0 episodes" in capsys.readouterr().out


@pytest.mark.parametrize("parent", ["sensor", "model", "recording"])
def test_a_label_of_something_else_stops_before_anything_is_written(
    recorded: Path, tmp_path: Path, monkeypatch, capsys, parent: str
) -> None:
    wrong = example.label(replace(example.episode(1), path=recorded / "episode-000001.mcap"))
    parents = {**wrong.provenance["parents"], parent: "9" * 64}
    wrong = replace(wrong, provenance={**wrong.provenance, "parents": parents})
    write_label(recorded / "labels" / "episode-000001.parquet", wrong)
    assert run(monkeypatch, recorded, "--out", tmp_path / "d") == 3
    error = capsys.readouterr().err
    assert f"made for {parent} 999999999999" in error
    assert "next:" in error
    assert not (tmp_path / "d").exists()


def test_the_model_asked_for(recorded: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    assert run(monkeypatch, recorded, "--out", tmp_path / "d", "--model", "7" * 64) == 3
    assert "model 777777777777, as asked for" in capsys.readouterr().err
    assert run(monkeypatch, recorded, "--out", tmp_path / "d", "--model", "c" * 64) == 0


def test_no_labels_folder(recorded: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    assert run(monkeypatch, recorded, "--labels", tmp_path / "none", "--out", tmp_path / "d") == 2
    assert "run `tacdata label` first" in capsys.readouterr().err


def test_a_damaged_label(recorded: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    path = recorded / "labels" / "episode-000001.parquet"
    path.write_bytes(path.read_bytes()[:-50])
    assert run(monkeypatch, recorded, "--out", tmp_path / "d") == 3
    assert "episode-000001.parquet is damaged" in capsys.readouterr().err
    assert not (tmp_path / "d").exists()


def test_a_sessions_flags_go_with_its_recordings(recorded: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    hashes = [provenance.file_hash(recorded / f"episode-{number:06d}.mcap") for number in range(3)]
    for number in (1, 2):  # the last is not packed
        set_flag(recorded, hashes[number], f"episode-{number:06d}.mcap", "the tool slipped")
    assert run(monkeypatch, recorded, "--out", tmp_path / "d") == 0
    assert "episode-000001.mcap  set aside, training leaves it out: the tool slipped" in capsys.readouterr().out
    assert flagged_episodes(read_dataset(tmp_path / "d")) == {1: "the tool slipped"}
    assert set(read_flags(tmp_path / "d")) == {hashes[1]}
    set_flag(tmp_path / "d", hashes[1], "episode-000001.mcap", "seen again: the skin lifted")
    assert carry_flags(recorded, tmp_path / "d") == []
    assert read_flags(tmp_path / "d")[hashes[1]].reason == "seen again: the skin lifted"
