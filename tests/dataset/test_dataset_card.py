"""The data card: what it counts, what it says is missing, and its picture."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import press_example as example
import pytest
import yaml

from tacdata.commands.card import run
from tacdata.dataset import LostProvenanceWarning, card, coverage_picture, pack, read_dataset
from tacdata.dataset.format import metadata
from tacdata.errors import UsageError
from tacdata.sensor import default_sensor


def packed(root: Path, episodes) -> Path:
    pack(episodes, example.label, root)
    return root


def test_the_card_says_what_is_inside(tmp_path: Path) -> None:
    text = card.card(read_dataset(packed(tmp_path / "d", [example.episode(n) for n in range(3)])))
    assert "3 episodes, 60 frames" in text
    assert "- tacprint `" in text
    assert "specimens: tacprint (3)" in text
    assert "| sphere0 | sphere, radius 2 to 4 | 2 | 1.2 | 1 |" in text
    assert "| sphere1 | sphere, radius 3 | 1 | 1.2 | 1 |" in text
    assert "skin model (content hash): cccccccccccc (3)" in text
    assert "3 episodes: made for a test" in text
    assert "| observation.depth | 35 x 26 | m | mm |" in text, "LeRobot keeps depth maps in metres"


def test_specimens_are_told_apart(tmp_path: Path) -> None:
    """Two sensors of one design differ in their name alone: one description, two specimens."""
    second = replace(default_sensor(), name="tacprint 2")
    episodes = [example.episode(0), example.episode(1, sensor=second), example.episode(2, sensor=second)]
    dataset = read_dataset(packed(tmp_path / "d", episodes))
    assert len(dataset.sensors) == 1
    assert [e.record.specimen for e in dataset.episodes] == ["tacprint", "tacprint 2", "tacprint 2"]
    assert "specimens: tacprint (1), tacprint 2 (2)" in card.card(dataset)


def test_presses_are_counted_by_place_and_depth(tmp_path: Path) -> None:
    dataset = read_dataset(packed(tmp_path / "d", [example.episode(0)]))
    press = dataset.episodes[0].press
    # The array's box is 11.4 x 10 mm: thirds end at +-1.9 and +-1.67 mm.
    places = [(-5.0, 0.0, 0.2), (1.0, 4.0, 0.7), (30.0, 30.0, 5.0), (0.0, 0.0, -1.0)]
    presses = [replace(press, x=x, y=y, depth=depth) for x, y, depth in places]
    found = card.coverage(presses, dataset)
    assert found.counts.sum() == 3
    assert found.counts[0, 1, 0] == found.counts[1, 2, 2] == found.counts[2, 2, 4] == 1
    assert found.empty == found.counts.size - 3


def test_lost_records_and_broken_recordings_are_gaps(tmp_path: Path) -> None:
    root = packed(tmp_path / "d", [example.episode(0), replace(example.episode(1), complete=False)])
    assert "1 recordings were broken off, the first is episode-000001.mcap" in card.card(read_dataset(root))
    lines = (root / metadata.RECORDS).read_text().splitlines()
    (root / metadata.RECORDS).write_text(lines[0] + "\n")
    with pytest.warns(LostProvenanceWarning):
        dataset = read_dataset(root)
    assert "1 episodes lost their record" in card.card(dataset)


def test_lost_frames_and_frames_outside_the_path_are_counted_apart(tmp_path: Path) -> None:
    """Three counts are missing before frame 9; the path begins at frame 2 and ends at frame 16."""
    whole = example.episode(0)
    counter = whole.taxels.counter + np.where(np.arange(20) >= 9, 3, 0)
    times = whole.taxels.sample_ns
    path_ns = times[[2, 6, 9, 12, 16]]
    lossy = replace(whole, taxels=replace(whole.taxels, counter=counter), tip_ns=path_ns)
    text = card.card(read_dataset(packed(tmp_path / "d", [lossy, example.episode(1)])))
    assert "- 1 of 40 frames follow a lost frame" in text
    assert "- 5 of 40 frames are outside the commanded path" in text


def test_the_picture_is_a_picture(tmp_path: Path) -> None:
    stream = io.BytesIO()
    coverage_picture.draw(stream, read_dataset(packed(tmp_path / "d", [example.episode(n) for n in range(2)])))
    from PIL import Image

    image = np.asarray(Image.open(stream).convert("L"))
    assert image.shape[1] > 900
    assert image.std() > 5


def test_records_of_an_earlier_release_open(tmp_path: Path) -> None:
    """A record without specimen, as version 1.0 wrote it."""
    root = packed(tmp_path / "d", [example.episode(0)])
    text = (root / metadata.RECORDS).read_text()
    assert '"specimen":"tacprint"' in text
    (root / metadata.RECORDS).write_text(
        text.replace(',"specimen":"tacprint"', "").replace('"version":"1.1"', '"version":"1.0"')
    )
    dataset = read_dataset(root)
    assert dataset.episodes[0].record.specimen == ""
    assert "specimens: not named (1)" in card.card(dataset)


def test_the_card_as_data_agrees_with_its_words(tmp_path):
    dataset = read_dataset(packed(tmp_path / "d", [example.episode(n) for n in range(3)]))
    data = card.document(dataset)
    assert (data["episodes"], data["frames"]) == (3, 60)
    assert [(entry["name"], entry["presses"]) for entry in data["indenters"]] == [("sphere0", 2), ("sphere1", 1)]
    words = card.card(dataset)
    assert f"- {data['frames_after_a_loss']} of 60 frames follow a lost frame" in words
    assert f"- {data['frames_outside_the_path']} of 60 frames are outside the commanded path" in words
    assert data["columns"]["observation.depth"]["unit"] == "mm"


def test_a_card_for_the_hub_is_written_once_and_the_upload_named(tmp_path, capsys):
    root = packed(tmp_path / "d", [example.episode(0)])
    run(root, push="me/presses")
    assert f"hf upload me/presses {root} . --repo-type dataset" in capsys.readouterr().out
    text = (root / "README.md").read_text()
    head = yaml.safe_load(text.split("---")[1])
    assert "LeRobot" in head["tags"] and head["configs"][0]["data_files"] == "data/*/*.parquet"
    assert "# Data card: d" in text
    with pytest.raises(UsageError, match=r"README\.md exists"):
        run(root, push="me/presses")
