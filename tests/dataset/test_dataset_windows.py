"""Windows: replicated ends, batches equal to single frames, refusals."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import press_example as example
import pytest
import torch

from tacdata.dataset import pack, read_dataset
from tacdata.dataset.format import features
from tacdata.dataset.windows import WindowDataset, centred
from tacdata.errors import FormatError, UsageError


@pytest.fixture
def root(tmp_path: Path) -> Path:
    lengths = (20, 5, 11)
    pack([example.episode(n, count) for n, count in enumerate(lengths)], example.label, tmp_path / "d")
    return tmp_path / "d"


def test_nine_frames_around_each_with_the_ends_repeated(root: Path) -> None:
    windows = WindowDataset(read_dataset(root))
    state = read_dataset(root)[features.STATE]
    for episode in windows.data.episodes:
        for frame in range(episode.start, episode.stop):
            wanted = np.arange(frame - 4, frame + 5)
            inside = wanted.clip(episode.start, episode.stop - 1)
            item = windows[frame]
            assert np.array_equal(item[features.STATE].numpy(), state[inside])
            assert np.array_equal(item[f"{features.STATE}_is_pad"].numpy(), wanted != inside)
            assert item[features.DEPTH].shape == (1, 35, 26)
            assert item["frame_index"] == frame - episode.start


def test_a_batch_is_its_frames(root: Path) -> None:
    offsets = {features.STATE: range(-8, 1), features.DEPTH: (-1, 0)}
    windows = WindowDataset(read_dataset(root), offsets, keys=[features.TIP, features.TIME])
    frames = [0, 19, 20, 24, 25, 35, -1]
    batch = windows[frames]
    assert set(batch) == {features.TIP, features.TIME, *offsets, *(f"{key}_is_pad" for key in offsets)}
    assert batch[features.STATE].shape == (7, 9, 24)
    assert batch[features.DEPTH].shape == (7, 2, 1, 35, 26)
    for place, frame in enumerate(frames):
        single = windows[frame]
        for key, values in batch.items():
            assert torch.equal(values[place], single[key]), key
    assert torch.equal(windows.batch(torch.tensor(frames))[features.STATE], batch[features.STATE])


def test_a_data_loader_reads_whole_batches(root: Path) -> None:
    windows = WindowDataset(read_dataset(root), keys=[features.DEPTH])
    sampler = torch.utils.data.BatchSampler(torch.utils.data.SequentialSampler(windows), 16, drop_last=False)
    batches = list(torch.utils.data.DataLoader(windows, sampler=sampler, batch_size=None))
    assert [len(batch[features.DEPTH]) for batch in batches] == [16, 16, 4]
    together = torch.cat([batch[features.STATE] for batch in batches])
    assert torch.equal(together, windows.batch(np.arange(36))[features.STATE])


def test_batches_may_be_changed_without_harm(root: Path) -> None:
    windows = WindowDataset(read_dataset(root))
    windows.batch([3])[features.STATE].fill_(7.0)
    assert windows.batch([3])[features.STATE].max() != 7.0


def test_refusals(root: Path) -> None:
    windows = WindowDataset(read_dataset(root))
    for frame in (36, -37):
        with pytest.raises(IndexError, match="of a dataset of 36"):
            windows[frame]
    with pytest.raises(FormatError, match="no column 'action'"):
        WindowDataset(read_dataset(root), keys=["action"])
    for length in (0, 8, -3):
        with pytest.raises(UsageError, match="odd"):
            centred(length)
    assert centred() == (-4, -3, -2, -1, 0, 1, 2, 3, 4)


def test_the_room_is_imported_without_torch_and_lerobot() -> None:
    heavy = "{'torch', 'lerobot', 'pandas', 'datasets'}"
    code = f"import sys, tacdata.dataset; print(sorted({heavy} & set(sys.modules)))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
