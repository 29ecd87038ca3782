"""Windows of neighbouring frames for torch, from memory maps, under LeRobotDataset's keys."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import torch  # noqa: TID253 - only who trains imports this module

from tacdata.dataset.format import features
from tacdata.errors import UsageError


def centred(length: int = 9) -> tuple[int, ...]:
    """Return the offsets -K ... K [frames] of a window of ``length`` = 2 K + 1 frames (paper: T = 9, K = 4).

    Raises:
        UsageError: If the length is even or not positive.
    """
    if length < 1 or length % 2 == 0:
        raise UsageError(f"a window of {length} frames", "an odd number of frames, 1 or more", "choose 9, for example")
    return tuple(range(-(length // 2), length // 2 + 1))


class EpisodeBounds(Protocol):
    """The frames of one episode."""

    @property
    def start(self) -> int:
        """First frame."""

    @property
    def stop(self) -> int:
        """One past the last frame."""

    @property
    def task(self) -> str:
        """Description of its task."""


class FrameColumns(Protocol):
    """The part of a dataset that windows are gathered from (`tacdata.dataset.reader.Dataset`)."""

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Column by name, frames first."""

    @property
    def episodes(self) -> Sequence[EpisodeBounds]:
        """Episodes in order."""

    def __len__(self) -> int:
        """Number of frames."""

    def __getitem__(self, key: str) -> np.ndarray:
        """Return a column."""


class WindowDataset(torch.utils.data.Dataset):
    """Frames with windows around them, as ``LeRobotDataset(delta_timestamps=...)`` gives them.

    Beyond an episode's ends its first or last frame is repeated, and ``KEY_is_pad`` is true. ``dataset[i]``
    is one frame; ``dataset[[i, j, ...]]`` and `batch` are a batch, so that a DataLoader with
    ``batch_size=None`` and a BatchSampler reads whole batches at once.

    Example:
        >>> from tacdata.dataset import read_dataset
        >>> windows = read_dataset("dataset", "cache").windows()
        >>> windows[50]["observation.state"].shape  # nine frames around frame 50, taxels
        torch.Size([9, 24])
    """

    def __init__(
        self,
        dataset: FrameColumns,
        offsets: Mapping[str, Iterable[int]] | None = None,
        keys: Sequence[str] | None = None,
    ) -> None:
        """Prepare the gather.

        Args:
            dataset: The dataset.
            offsets: Column -> frames of its window relative to the frame asked for; None takes the paper's
                nine around it for `features.STATE`. Columns not named here give the one frame.
            keys: Columns to return; None returns all.

        Raises:
            FormatError: If a column is not in the dataset.
        """
        self.data = dataset
        spans = {features.STATE: centred()} if offsets is None else offsets
        self.offsets = {key: np.array(tuple(frames), dtype=np.int64) for key, frames in spans.items()}
        self.keys = tuple(self.data.columns) if keys is None else tuple(keys)
        # Plain views of the memory maps: numpy's own class for them costs time in every gather.
        self._columns = {key: np.asarray(self.data[key]) for key in (*self.keys, *self.offsets)}
        self._episode_of = np.asarray(self.data["episode_index"])
        self._starts = np.array([episode.start for episode in self.data.episodes])
        self._lasts = np.array([episode.stop - 1 for episode in self.data.episodes])

    def __len__(self) -> int:
        """Number of frames, each with its window."""
        return len(self.data)

    def __repr__(self) -> str:
        """Return the number of frames, and the length of each window."""
        spans = ", ".join(f"{len(frames)} of {key}" for key, frames in self.offsets.items())
        return f"Windows of {len(self)} frames: {spans}"

    def __getitem__(self, index: int | Sequence[int]) -> dict[str, Any]:
        """Return one frame as LeRobotDataset would, or a batch for a sequence of frames.

        Raises:
            IndexError: If a frame is not in the dataset.
        """
        if not isinstance(index, int | np.integer):
            return self.batch(index)
        item: dict[str, Any] = {key: value[0] for key, value in self.batch([int(index)]).items()}
        item["task"] = self.data.episodes[int(self._episode_of[int(index)])].task
        return item

    def batch(self, indices: Sequence[int] | np.ndarray | torch.Tensor) -> dict[str, torch.Tensor]:
        """Return the frames and their windows.

        Args:
            indices: Frames, shape (b,); negative ones count from the end.

        Returns:
            Column -> tensor (b, ...), or (b, T, ...) with ``KEY_is_pad`` (b, T) where it has a window. Depth
            maps have LeRobot's channel axis: (b, 1, pixels_x, pixels_y) [mm].

        Raises:
            IndexError: If a frame is not in the dataset.
        """
        frames = np.asarray(indices, dtype=np.int64)
        frames = np.where(frames < 0, frames + len(self), frames)
        if frames.size and (frames.min() < 0 or frames.max() >= len(self)):
            raise IndexError(f"frames {frames.min()} to {frames.max()} of a dataset of {len(self)}")
        episode = self._episode_of[frames]
        first, last = self._starts[episode][:, None], self._lasts[episode][:, None]
        result: dict[str, torch.Tensor] = {}
        for key, column in self._columns.items():
            if key in self.offsets:
                positions = frames[:, None] + self.offsets[key]
                inside = np.clip(positions, first, last)
                result[key] = self._tensor(key, np.take(column, inside, axis=0))
                result[f"{key}_is_pad"] = torch.from_numpy(positions != inside)
            else:
                result[key] = self._tensor(key, np.take(column, frames, axis=0))
        return result

    def _tensor(self, key: str, values: np.ndarray) -> torch.Tensor:
        tensor = torch.from_numpy(np.asarray(values))
        return tensor.unsqueeze(-3) if key == features.DEPTH else tensor
