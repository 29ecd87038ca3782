"""Windows of neighbouring frames, gathered on the fly from the flat array (paper, eq. temporal_window)."""

from __future__ import annotations

import torch

from tacdata.training.frames.frames import Frames


class Windows:
    """All windows of a dataset on one device; boundary frames are replicated inside each episode."""

    def __init__(self, frames: Frames, offsets: tuple[int, ...], device: torch.device | str = "cpu") -> None:
        """Move the signals to ``device``.

        Args:
            frames: The dataset.
            offsets: Frames of the window relative to the target frame, for example -4 ... 4.
            device: Where the signals lie and batches are gathered.
        """
        self.taxels = torch.tensor(frames.taxels, dtype=torch.float32, device=device)
        lengths = torch.tensor([e.stop - e.start for e in frames.episodes])
        self.first = torch.tensor([e.start for e in frames.episodes]).repeat_interleave(lengths).to(device)
        self.last = torch.tensor([e.stop - 1 for e in frames.episodes]).repeat_interleave(lengths).to(device)
        self.offsets = torch.tensor(offsets).to(device)

    def __len__(self) -> int:
        """Number of frames, each with its window."""
        return len(self.taxels)

    def index(self, frames: torch.Tensor) -> torch.Tensor:
        """Return the frame numbers of the windows around ``frames``, shapes (b,) -> (b, T), int64."""
        indices = frames[:, None] + self.offsets
        return torch.minimum(torch.maximum(indices, self.first[frames, None]), self.last[frames, None])

    def batch(self, frames: torch.Tensor) -> torch.Tensor:
        """Return the windows around ``frames`` [counts], shapes (b,) -> (b, T, taxels), float32."""
        return self.taxels[self.index(frames)]
