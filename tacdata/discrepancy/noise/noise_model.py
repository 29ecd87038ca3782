"""The noise model: how readings scatter around the truth, within an episode and from one to the next."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tacdata.discrepancy.noise.offset_process import OffsetProcess


@dataclass(frozen=True)
class Noise:
    """How readings scatter around the truth."""

    scale: np.ndarray
    """Standard deviation of the innovations [each stream's unit], shape (streams,)."""
    memory: float
    """Correlation of rows that are `step` apart [1]."""
    step: float
    """Median time between rows of the recordings it was estimated from [s]: others may be spaced otherwise."""
    offsets: OffsetProcess | None = None
    """How episodes' offsets go on from one to the next; None leaves each free."""
    gain_error: np.ndarray | None = None
    """Effect of one standard deviation of an episode's own gain of a stream [its unit], shape (n, streams)."""
    missing: np.ndarray | None = None
    """Which values were not read, shape (n, streams), bool; None: all were."""
    random_walk: np.ndarray | None = None
    """Effect of one standard deviation of each mode of the random walk within an episode [noise scales], shape
    (n, modes); None: there is none."""
    walk_rate: float = 0.0
    """Rate of that random walk [noise scales squared a second]."""
    relative_scale: np.ndarray | None = None
    """How much larger noise is in each value than without load [1], shape (n, streams); None: it is not."""
    tag: float | None = None
    """Standard deviation of an episode's own offset of the tag's streams (the last three), in noise scales [1]; they
    have a free offset for each place and know nothing of the response. None: there is no tag."""

    def of(self, rows: np.ndarray, episodes: np.ndarray | None = None) -> Noise:
        """Return the noise of some rows, shape (n,), bool; ``episodes`` are those left, if they are renumbered."""
        each = {name: getattr(self, name) for name in ("gain_error", "missing", "random_walk", "relative_scale")}
        fields = {name: None if value is None else value[rows] for name, value in each.items()}
        return replace(self, **fields, offsets=None if self.offsets is None else self.offsets.of(rows, episodes))
