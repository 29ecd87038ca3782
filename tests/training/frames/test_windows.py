"""Windows replicate boundary frames inside each episode and never reach into a neighbour."""

import numpy as np
import torch

from tacdata.training.frames.windows import Windows
from tacdata.training.networks.paper import Paper


def reference(start, stop, frame):
    """The paper's pi(n) = min(max(n, 1), N), frame by frame."""
    return [min(max(frame + k, start), stop - 1) for k in range(-4, 5)]


def test_every_window_is_that_of_the_paper(frames):
    windows = Windows(frames, Paper.offsets)
    index = windows.index(torch.arange(len(windows))).numpy()
    expected = [reference(e.start, e.stop, k) for e in frames.episodes for k in range(e.start, e.stop)]
    np.testing.assert_array_equal(index, expected)


def test_a_batch_holds_the_readings_in_order(frames):
    windows = Windows(frames, (-8, 0, 1))
    batch = windows.batch(torch.tensor([0, 30]))
    assert batch.shape == (2, 3, 24)
    np.testing.assert_array_equal(batch[0], frames.taxels[[0, 0, 1]])
    np.testing.assert_array_equal(batch[1], frames.taxels[[24, 30, 31]])
