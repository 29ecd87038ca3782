"""A processed demonstration: fingertip paths on one time grid, with touch."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tacdata.demonstrations import touch
from tacdata.sensor import Sensor

GUESS = 0.003
"""Standard deviation of an axis above which a place that no steady camera saw is a guess [m]; a grasp tolerates no
more.
"""


@dataclass(frozen=True, eq=False)
class FingerTrack:
    """One finger's path on the demonstration's grid, with readings and predicted depth."""

    finger: str
    hand: str
    """"left", "right" or unknown."""
    kind: str
    """"thumb", "index", "middle", ... or unknown."""
    position: np.ndarray
    """Fingertip's origin [m], shape (n, 3); NaN before the first and after the last sighting."""
    quaternion: np.ndarray
    """From the fingertip's frame to the demonstration's, xyzw [1], shape (n, 4); NaN likewise."""
    covariance: np.ndarray
    """Covariance of a small rotation [rad] and the position [m], both in the demonstration's frame, shape (n, 6, 6)."""
    gap: np.ndarray
    """Whether no sighting is near, or only one of a camera that was moved, shape (n,), bool: the pose is a guess."""
    sightings: int
    """Images in which the finger was seen."""
    outliers: int
    """Outliers: sightings left out because they contradict the others."""
    signals: np.ndarray | None = None
    """Tared readings [counts], shape (n, taxels), float32; NaN where the board sent nothing. None without board."""
    depth: np.ndarray | None = None
    """PREDICTED depth [mm], shape (n, pixels_x, pixels_y), float32: a network's estimate, never a measurement; NaN
    where it had no reading. None without a network."""
    novelty: np.ndarray | None = None
    """Novelty of the readings against the training data [1], shape (n,), float32. Above 1 they are farther than nearly
    all of the validation data, and the depth is a guess. None if the network's run does not hold it.
    """

    @property
    def normal(self) -> np.ndarray:
        """Unit normal out of the pad, towards the object [1], shape (n, 3): the fingertip frame's z."""
        x, y, z, w = self.quaternion.T
        return np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=-1)


@dataclass(frozen=True, eq=False)
class Demonstration:
    """A processed demonstration: all fingers on one time grid."""

    recording: str
    """File name of the recording."""
    recording_hash: str
    """Its SHA-256."""
    task: str
    frame: str
    """Frame of all poses: the world's name, or "camera NAME"."""
    rate: float
    """Rate of the grid [Hz]."""
    time_ns: np.ndarray
    """Times of the grid on the recording's clock [ns], shape (n,), int64."""
    tracks: dict[str, FingerTrack]
    sensors: dict[str, Sensor]
    """Finger -> its skin, of fingers with a board."""
    smoothing: dict[str, Any] = field(default_factory=dict)
    """Settings of the smoother and the process noise that it chose, by finger."""
    network: dict[str, Any] | None = None
    """Network behind the predicted depth: hash, network, epoch, lookahead [frames], sensor; None without. Where each
    finger has its own, their identities are under ``fingers``, and the hash is of all hashes.
    """
    remarks: tuple[str, ...] = ()
    """Remarks for a person, as sentences."""
    provenance: dict[str, Any] = field(default_factory=dict)

    @property
    def networks(self) -> dict[str, dict[str, Any]]:
        """Finger -> identity of the network behind its predicted depth; fingers without one are missing."""
        if self.network is None:
            return {}
        felt = [name for name, track in self.tracks.items() if track.depth is not None]
        each = self.network.get("fingers", dict.fromkeys(felt, self.network))
        return {name: each[name] for name in felt if name in each}

    def guesses(self, fingers: Iterable[str] = ()) -> list[str]:
        """Describe where the predicted depth of some fingers (by default all) is a guess.

        That is where the network has not been trained on similar readings, and all of it if it is fitted to no unit.
        """
        words, selection = [], tuple(fingers) or tuple(self.tracks)
        networks = {name: network for name, network in self.networks.items() if name in selection}
        words += dict.fromkeys(network["unfitted"] for network in networks.values() if "unfitted" in network)
        for name, track in self.tracks.items():
            if name in selection and track.signals is not None and track.novelty is not None:
                words += touch.unknown(name, track.signals, track.novelty)
        return words

    @property
    def seconds(self) -> np.ndarray:
        """Times since the grid's beginning [s], shape (n,)."""
        return (self.time_ns - self.time_ns[0]) * 1e-9
