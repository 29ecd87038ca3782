"""Networks as this room uses them: one for all fingers, or one for each fingertip."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata import provenance
from tacdata.errors import FormatError, UsageError
from tacdata.sensor import Sensor

ALL = ""
"""Key of the network for every finger without its own."""


@dataclass(frozen=True)
class Estimator:
    """A trained network, as this room uses it."""

    identity: dict[str, Any]
    """Identity: hash, network, epoch, lookahead [frames], sensor hash; ``unfitted``: why it is fitted to no unit."""
    sensor: Sensor
    maps: Callable[[np.ndarray], np.ndarray]
    """Function from tared readings of successive frames [counts], shape (m, taxels), to depth [mm], shape (m, pixels_x,
    pixels_y).
    """
    novelty: Callable[[np.ndarray], np.ndarray] | None = None
    """Function from tared readings to their novelty [1], shape (m,); None if it is not known."""

    def check_sensor(self, finger: str, sensor: Sensor) -> None:
        """Refuse a finger that wears another sensor.

        Raises:
            FormatError: Saying both.
        """
        if sensor.content_hash != self.sensor.content_hash:
            raise FormatError(
                f"{finger} wears sensor {sensor.name} ({sensor.content_hash[:12]}), the network was trained for "
                f"{self.sensor.name} ({self.sensor.content_hash[:12]})",
                "a network of the sensor that the fingers wear",
                "name the right sensor in the demo rig, or train anew",
            )


def by_finger(estimators: Estimator | Mapping[str, Estimator] | None, fingers: tuple[str, ...]) -> dict[str, Estimator]:
    """Return each finger's estimator; fingers without one are missing.

    Args:
        estimators: One for all, or finger -> estimator, in which `ALL` is the default.
        fingers: Fingers with a board.

    Raises:
        UsageError: If a finger is named that has no board.
    """
    if estimators is None:
        return {}
    named = {ALL: estimators} if isinstance(estimators, Estimator) else dict(estimators)
    unknown = sorted(set(named) - {ALL, *fingers})
    if unknown:
        raise UsageError(
            f"a network for {', '.join(unknown)}, of which there is no board",
            ", ".join(fingers) or "no finger",
            "correct the names in --network",
        )
    assignment = {finger: named.get(finger, named.get(ALL)) for finger in fingers}
    return {finger: estimator for finger, estimator in assignment.items() if estimator is not None}


def identity_of(estimators: Mapping[str, Estimator]) -> dict[str, Any] | None:
    """Return which networks predicted: the one of all, or all of them under ``fingers``; None without any."""
    identities = {finger: estimator.identity for finger, estimator in estimators.items()}
    if not identities:
        return None
    first = next(iter(identities.values()))
    if all(identity == first for identity in identities.values()):
        return first
    return {
        **first,
        "hash": provenance.content_hash([entry["hash"] for entry in identities.values()]),
        "fingers": identities,
    }
