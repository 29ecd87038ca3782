"""Estimates depth maps at the sensor's rate, by a network over a sliding window of frames."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tacdata.demonstrations.compensation import contact_depth
from tacdata.devices.device import TaxelFrame
from tacdata.errors import UsageError
from tacdata.recording.clocks.running_clock import StreamClock
from tacdata.sensor import DepthMap

REGION = 0.4
"""Depth above which a pixel belongs to the contact region [mm] (paper, Exp. 3)."""
STILL = 6.0
"""Largest spread of readings while taring, over their frame-to-frame noise [1]."""
BELOW = 12.0, 0.01
"""Deviation of readings below the tare that casts doubt on it: over the noise, and as a share of the reading [1]. Touch
raises readings.
"""


@dataclass(frozen=True, eq=False)
class Estimate:
    """A network's estimate of the depth map of one frame."""

    sequence: int
    """Number of the estimate."""
    sample_ns: int
    """Estimated sample time of its frame [ns]."""
    arrival_ns: int
    """When the newest frame used arrived [ns]."""
    depth: np.ndarray
    """Map [mm], shape (pixels_x, pixels_y), float32."""
    largest: float
    """Mean of the ten largest depths [mm]."""
    centre: tuple[float, float] | None
    """Centroid of the pixels deeper than `REGION` in the sensor's frame [mm]; None without contact."""
    novelty: float | None = None
    """Novelty: distance of the reading from all training readings, over the limit [1]; None if it is not known."""
    below_tare: float = 0.0
    """Deviation of readings at rest below the tare [counts]: the skin was touched while it was tared. 0 if there is
    none.
    """


class DepthStream:
    """Takes frames one by one; returns an estimate for each once its window is full.

    The first frames at rest are for taring: nothing may touch the skin. While it moves, taring waits. Touch raises a
    reading. So a skin that was held still while it was tared shows itself later: readings lie below the tare.

    A centred window estimates the frame ``lookahead`` frames before the newest one.

    With ``causal`` the newest frame is estimated, and it is repeated in place of the network's later frames, as
    training did at the end of an episode. That is right for a constant contact, and late for a changing one.
    """

    def __init__(
        self,
        estimate: Callable[[np.ndarray], np.ndarray],
        offsets: Sequence[int],
        grid: DepthMap,
        clock: StreamClock,
        tare_frames: int,
        causal: bool = False,
        novelty: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> None:
        """Begin without frames.

        Args:
            estimate: Window of tared readings [counts], shape (len(offsets), taxels) -> map [mm].
            offsets: Frames of the window relative to its target, ascending.
            grid: The sensor's pixels.
            clock: The board's clock, from which the frames' sampling times follow.
            tare_frames: Frames at rest over which the reading without contact is averaged.
            causal: Whether to estimate the newest frame.
            novelty: Tared readings (m, taxels) -> novelty [1], shape (m,).

        Raises:
            UsageError: If there is no frame for taring.
        """
        if tare_frames < 1:
            raise UsageError(f"taring over {tare_frames} frames", "one or more", "give --tare more time")
        self._estimate, self._offsets, self._grid, self._clock = estimate, tuple(offsets), grid, clock
        self.causal, self.lookahead = causal, 0 if causal else max(max(offsets), 0)
        self._novelty = novelty
        self._tare: deque[np.ndarray] = deque(maxlen=tare_frames)
        self._recent: deque[np.ndarray] = deque(maxlen=max(tare_frames // 2, 2))
        self._noise: np.ndarray = np.ones(1)
        self._frames: deque[tuple[np.ndarray, int]] = deque(maxlen=1 + max(offsets) - min(*offsets, 0))
        self._sequence = 0
        self.baseline: np.ndarray | None = None
        """Reading without touch [counts], shape (taxels,), once it is known."""
        self.waiting_for_rest = ""
        """Why taring has not ended, in words; empty if it has or is under way."""

    def tare(self) -> None:
        """Tare again, over the next frames at rest."""
        self.baseline, self.waiting_for_rest = None, ""
        self._tare.clear()
        self._recent.clear()
        self._frames.clear()

    def push(self, frame: TaxelFrame, is_needed: bool = True) -> Estimate | None:
        """Take a frame; return the estimate that it completes, or None while taring and at the beginning.

        Args:
            frame: The next frame.
            is_needed: Whether the estimate is wanted; without it the frame only enters the window.
        """
        counter = frame.device_ns if self._clock.axis == "device_ns" else frame.counter
        sample_ns = self._clock.take(frame.arrival_ns, counter)
        if self.baseline is None:
            self._tare.append(frame.counts)
            if len(self._tare) == self._tare.maxlen:
                self._noise, self.waiting_for_rest = _at_rest(np.array(self._tare))
                if not self.waiting_for_rest:
                    self.baseline = np.mean(self._tare, axis=0)
            return None
        tared = frame.counts - self.baseline
        self._recent.append(tared)
        self._frames.append((tared, sample_ns))
        newest = len(self._frames) - 1
        target = newest - self.lookahead
        if target < 0:
            return None
        self._sequence += 1
        if not is_needed:
            return None
        # Frames before the first and behind the newest are replaced by those, as in training.
        rows = np.clip(target + np.array(self._offsets), 0, newest)
        depth = self._estimate(np.array([self._frames[row][0] for row in rows]))
        novelty = float(self._novelty(self._frames[target][0][None])[0]) if self._novelty else None
        return Estimate(
            self._sequence - 1,
            self._frames[target][1],
            frame.arrival_ns,
            depth,
            float(contact_depth(depth[None])[0]),
            contact_centre(depth, self._grid),
            novelty,
            self._below_tare(),
        )

    def _below_tare(self) -> float:
        """Return the deviation of the latest readings below the tare [counts], if they are at rest."""
        if self.baseline is None or len(self._recent) < (self._recent.maxlen or 0):
            return 0.0
        # All of them: a single low frame is noise, or a channel that dropped out for a moment.
        highest = np.max(self._recent, axis=0)
        limit = np.maximum(BELOW[0] * self._noise, BELOW[1] * np.abs(self.baseline))
        return float(-highest.min()) if (highest < -limit).any() else 0.0


def contact_centre(depth: np.ndarray, grid: DepthMap, threshold: float = REGION) -> tuple[float, float] | None:
    """Return the centroid of the pixels deeper than a threshold, x and y [mm, sensor frame]; None if there is none."""
    inside = np.argwhere(depth > threshold)
    if not len(inside):
        return None
    x, y = ((inside.mean(axis=0) - (np.array(depth.shape) - 1) / 2) * grid.pixel_pitch).tolist()
    return x, y


def _at_rest(counts: np.ndarray) -> tuple[np.ndarray, str]:
    """Return the noise of readings, shape (n, taxels), [counts], shape (taxels,), and why they are not at rest."""
    if len(counts) < 2:
        return np.ones(counts.shape[1]), ""
    noise = np.median(np.abs(np.diff(counts, axis=0)), axis=0) + 1.0
    part = max(len(counts) // 4, 1)
    drift = np.abs(counts[-part:].mean(axis=0) - counts[:part].mean(axis=0))
    if (drift > STILL * noise).any():
        return noise, f"taxel {int(np.argmax(drift / noise))} changed by {drift.max():.0f} counts while it was tared"
    return noise, ""
