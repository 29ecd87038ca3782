"""Targets of a robot's fingertips over time: as seen, or moved by the contact depth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tacdata import provenance, schemas
from tacdata.demonstrations.compensation import compensate, contact_depth
from tacdata.demonstrations.demonstration import GUESS, Demonstration
from tacdata.demonstrations.paths.path_faults import CONTRADICTING
from tacdata.errors import UsageError

FAR = 0.05
"""Shift by compensation that is reported [m]; the paper's gains move a target by at most 36 mm."""
VAGUE = 0.03
"""Share of the targets that may be known worse than `GUESS` though the finger was seen [1]."""
UNITS = {"time_ns": "ns", "position": "m", "quaternion": "1 (xyzw)", "seen": "m", "depth": "mm", "gap": "1"}


@dataclass(frozen=True, eq=False)
class FingertipTargets:
    """Fingertip targets of one demonstration."""

    recording: str
    recording_hash: str
    task: str
    frame: str
    """Frame of the poses."""
    rate: float
    """[Hz]"""
    fingers: tuple[str, ...]
    """Order of the fingers in the arrays, f of them."""
    kind: str
    """"direct" or "compensated"."""
    gains: dict[str, float]
    """Finger -> gain [m/mm]; empty for direct targets."""
    time_ns: np.ndarray
    """Times on the recording's clock [ns], shape (n,), int64."""
    position: np.ndarray
    """Targets [m], shape (n, f, 3)."""
    quaternion: np.ndarray
    """From each fingertip's frame (x along the finger, z out of the pad), xyzw [1], shape (n, f, 4)."""
    seen: np.ndarray
    """Where the fingertips were seen [m], shape (n, f, 3)."""
    depth: np.ndarray
    """Predicted contact depth [mm], shape (n, f); NaN where unknown."""
    gap: np.ndarray
    """Whether the pose is interpolated over a gap, shape (n, f), bool."""
    network: dict[str, Any] | None = None
    """Network behind the predicted depth."""
    remarks: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)
    source: Demonstration | None = None
    """The demonstration; None for targets read from a file."""
    rows: slice = slice(None)
    """Rows of the source at these times."""
    readings: np.ndarray | None = None
    """Sum of each finger's tared readings [counts], shape (n, f); None where a finger has no board."""

    @property
    def normals(self) -> np.ndarray:
        """Normals out of the pads [1], shape (n, f, 3): the fingertip frame's z."""
        x, y, z, w = np.moveaxis(self.quaternion, -1, 0)
        return np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=-1)

    def header(self, columns: Iterable[str]) -> dict[str, Any]:
        """Return the header of a file (`schemas/fingertip_targets.schema.json`)."""
        names = ("recording", "recording_hash", "task", "frame", "rate", "kind", "gains", "network", "provenance")
        return {
            "version": schemas.version("fingertip_targets"),
            **{name: getattr(self, name) for name in names},
            "frames": len(self.time_ns),
            "fingers": list(self.fingers),
            "units": UNITS,
            "columns": list(columns),
            "remarks": list(self.remarks),
        }


def targets_of(
    demonstration: Demonstration, gains: dict[str, float] | None, fingers: Iterable[str] = ()
) -> FingertipTargets:
    """Return a demonstration's targets, over the times at which every finger's pose is known.

    Args:
        demonstration: The demonstration.
        gains: Finger -> gain [m/mm] of compensated targets; None for direct ones.
        fingers: Fingers in their order; by default all.

    Raises:
        UsageError: If a finger has no path or no gain, no time has all of them, or there is no predicted depth.
    """
    names = tuple(fingers) or tuple(demonstration.tracks)
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise UsageError(f"finger {twice} is named twice", "each finger once", "name every finger once with --finger")
    for what, entries in (("path", demonstration.tracks), *((("gain", gains),) if gains is not None else ())):
        missing = [name for name in names if name not in entries]
        if missing:
            fault = f"no {what} for {', '.join(missing)}"
            remedy = "name other fingers with --finger" + (", or give them a gain" if what == "gain" else "")
            raise UsageError(fault, ", ".join(entries), remedy)
    tracks = [demonstration.tracks[name] for name in names]
    mask = np.all([np.isfinite(track.position).all(axis=1) for track in tracks], axis=0)
    if not mask.any():
        raise UsageError(f"no time at which {', '.join(names)} are all seen", "one or more", "choose fewer fingers")
    # Only the ends are cut off: gaps between them are bridged and marked.
    first, last = np.flatnonzero(mask)[[0, -1]]
    rows, remarks = slice(int(first), int(last) + 1), list(demonstration.remarks)
    depths = [_depth(track.depth, len(demonstration.time_ns)) for track in tracks]
    observed = np.stack([track.position for track in tracks], axis=1)
    position = observed.copy()
    if gains is not None:
        if demonstration.network is None:
            raise UsageError(
                "compensated targets without predicted depth",
                "demonstrations tracked with a network",
                "run tacdata track with --network, or export --direct",
            )
        for k, (name, track) in enumerate(zip(names, tracks, strict=True)):
            position[:, k] = compensate(observed[:, k], track.normal, depths[k], gains[name])
            away = float(np.nanmax(np.linalg.norm(position[rows, k] - observed[rows, k], axis=1)))
            if away > FAR:
                question = f"is the gain of {gains[name]:g} m/mm meant?"
                remarks.append(f"{name}: moved by up to {1000 * away:.0f} mm: {question}")
            blind = int(np.isnan(depths[k][rows]).sum())
            if blind:
                count = rows.stop - rows.start
                remarks.append(f"{name}: not moved at {blind} of {count} times, as no depth is predicted there")
    used = {name: float(gains[name]) for name in names} if gains is not None else {}
    kind, parents = "direct" if gains is None else "compensated", {"recording": demonstration.recording_hash}
    if demonstration.network:
        parents["checkpoint"] = demonstration.network["hash"]
    return FingertipTargets(
        demonstration.recording,
        demonstration.recording_hash,
        demonstration.task,
        demonstration.frame,
        demonstration.rate,
        names,
        kind,
        used,
        demonstration.time_ns[rows],
        position[rows],
        np.stack([t.quaternion for t in tracks], axis=1)[rows],
        observed[rows],
        np.stack(depths, axis=1)[rows],
        np.stack([t.gap for t in tracks], axis=1)[rows],
        demonstration.network,
        tuple(remarks),
        provenance.stamp("tacdata export", parents, {"kind": kind, "gains": used}),
        demonstration,
        rows,
        _readings([track.signals for track in tracks], rows),
    )


def doubts(targets: FingertipTargets) -> list[str]:
    """Describe the doubtful parts of a demonstration's targets: stretches without sightings, and those that contradict.

    A target over a gap is a guess where its standard deviation exceeds `GUESS`.
    """
    words = []
    tracks = targets.source.tracks if targets.source else {}
    for name, track in ((name, tracks[name]) for name in targets.fingers if name in tracks):
        if track.outliers > CONTRADICTING * track.sightings:
            words.append(f"{name}: {track.outliers} of {track.sightings} sightings contradicted the others")
    for name, bridged, spread in _bridged(targets):
        if (vague := ~bridged & (spread > GUESS)).any():
            words.append(
                f"{name}: {vague.sum()} of {len(vague)} targets were seen and are still uncertain, with standard "
                f"deviations of up to {1000 * spread[vague].max():.0f} mm"
            )
        if not bridged.any():
            continue
        rows = np.flatnonzero(bridged)
        longest = max(np.split(rows, 1 + np.flatnonzero(np.diff(rows) > 1)), key=len)
        begin = (targets.time_ns[longest[0]] - targets.time_ns[0]) * 1e-9
        words.append(
            f"{name}: {bridged.sum()} of {len(bridged)} targets bridge gaps without a sighting, the longest "
            f"{len(longest) / targets.rate:.1f} s from {begin:.1f} s on, where they are known to "
            f"{1000 * spread[rows].max():.1f} mm"
        )
    return words


def check_guesses(targets: FingertipTargets) -> None:
    """Refuse targets of which some are guesses.

    Raises:
        UsageError: Naming the finger, how much of the path, and its standard deviation.
    """
    for name, bridged, spread in _bridged(targets):
        guess = bridged & (spread > GUESS)
        vague = ~bridged & (spread > GUESS)
        if guess.any():
            raise UsageError(
                f"{targets.recording}: {name} was not seen for {guess.sum() / targets.rate:.1f} s by a camera in its "
                f"place; its targets there are guesses with a standard deviation of up to "
                f"{1000 * spread[guess].max():.0f} mm",
                f"targets known to {1000 * GUESS:g} mm, or a stretch without gaps",
                "record again with the cubes in view, export fingers that were seen (--finger), or let them pass with "
                "--with-guesses",
            )
        if vague.mean() > VAGUE:
            raise UsageError(
                f"{targets.recording}: {name} was seen, and {vague.mean():.0%} of its targets are uncertain, with a "
                f"standard deviation of up to {1000 * spread[vague].max():.0f} mm",
                f"targets known to {1000 * GUESS:g} mm at {1 - VAGUE:.0%} of the times",
                "record again: on a host that keeps up, with cubes nearer to the cameras, or with a camera that stamps "
                "its images; or let them pass with --with-guesses",
            )


def _bridged(targets: FingertipTargets) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Return for each finger where its targets bridge a gap, and their standard deviation [m]; shape (n,) both."""
    if targets.source is None:
        return []
    bridges = []
    for k, name in enumerate(targets.fingers):
        covariance = targets.source.tracks[name].covariance[targets.rows]
        # The position comes after the rotation in the covariance.
        spread = np.sqrt(np.max(np.diagonal(covariance[:, 3:, 3:], axis1=1, axis2=2), axis=1))
        bridges.append((name, targets.gap[:, k], spread))
    return bridges


def _readings(signals: list[np.ndarray | None], rows: slice) -> np.ndarray | None:
    found = [np.nansum(values[rows], axis=1) for values in signals if values is not None]
    return np.stack(found, axis=1) if len(found) == len(signals) else None


def _depth(maps: np.ndarray | None, count: int) -> np.ndarray:
    return np.full(count, np.nan) if maps is None else contact_depth(maps)
