"""Poses of one finger from all cameras, in the world, in the order of time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from tacdata.demonstrations.recording.rig import DemoRig
from tacdata.recording.episode import TagStream

FLOOR = 0.0002, float(np.radians(0.2))
"""Standard deviation [m], [rad] of every sighting beyond its image noise: print, mounting, calibration."""
UNKNOWN = 0.002, float(np.radians(3.0))
"""Standard deviation [m], [rad] of a sighting without a stored covariance, or with an impossible one."""
LONGEST = 1.0
"""Largest uncertainty of a time that is multiplied by a speed [s]."""
UNIT = 0.01
"""Largest deviation of a quaternion's length from 1 [1]."""
ROUNDING = 1e-12
"""Largest negative eigenvalue of a covariance that is rounding [m^2, rad^2]."""


@dataclass(frozen=True, eq=False)
class CameraError:
    """Error of a camera's pose in its file: the same for all of its sightings."""

    place: np.ndarray
    """Position of the camera in the world [m], shape (3,): a rotation of the camera turns its sightings about it."""
    spread: tuple[float, float]
    """Standard deviation of its position [m] and rotation [rad], per axis."""


@dataclass(frozen=True, eq=False)
class Sightings:
    """Poses of one fingertip from all cameras, in the world's frame."""

    finger: str
    time_ns: np.ndarray
    """Times of exposure [ns], shape (p,), int64, ascending."""
    position: np.ndarray
    """Fingertip's origin [m], shape (p, 3)."""
    rotation: np.ndarray
    """Rotation from the fingertip's frame to the world's [1], shape (p, 3, 3)."""
    covariance: np.ndarray
    """Covariance of a small rotation in the world [rad] and the position [m], shape (p, 6, 6)."""
    ambiguous: np.ndarray
    """Whether a second pose explains the image about as well, shape (p,), bool."""
    camera: tuple[str, ...]
    """Camera of each sighting."""
    ids: tuple[tuple[int, ...], ...]
    """Tags of each sighting, ascending."""
    timing: np.ndarray
    """Standard uncertainty of each time [s], shape (p,)."""
    cameras: dict[str, CameraError] = field(default_factory=dict)
    """Camera -> the error common to all of its sightings; cameras without an entry have none stated."""

    def __len__(self) -> int:
        """Number of sightings."""
        return len(self.time_ns)

    def where(self, mask: np.ndarray) -> Sightings:
        """Return some of the sightings; ``mask`` has shape (p,), bool."""
        indices = np.flatnonzero(mask)
        return Sightings(
            self.finger,
            self.time_ns[mask],
            self.position[mask],
            self.rotation[mask],
            self.covariance[mask],
            self.ambiguous[mask],
            tuple(self.camera[k] for k in indices),
            tuple(self.ids[k] for k in indices),
            self.timing[mask],
            self.cameras,
        )


def sightings_of(
    finger: str, views: Iterable[TagStream], rig: DemoRig, timing: dict[str, float] | None = None
) -> Sightings:
    """Return a finger's sightings from the streams of all cameras, in the rig's world.

    A stored covariance includes image noise only. Added are the camera's own uncertainty, `FLOOR`, and the finger's
    speed times the uncertainty of the image's time.

    Args:
        finger: Name of the finger.
        views: Streams of the cameras.
        rig: The rig, with the cameras' poses.
        timing: Camera -> standard uncertainty of its images' times [s], beyond each image's own.
    """
    parts = [_of_camera(view, rig, (timing or {}).get(view.camera, 0.0)) for view in views if view.finger == finger]
    parts = [part for part in parts if len(part)]
    if not parts:
        empty = np.zeros((0, 3))
        return Sightings(
            finger,
            np.zeros(0, np.int64),
            empty,
            np.zeros((0, 3, 3)),
            np.zeros((0, 6, 6)),
            np.zeros(0, bool),
            (),
            (),
            np.zeros(0),
        )
    time_ns = np.concatenate([part.time_ns for part in parts])
    # Stable: of equal times the order of the cameras is the same at each run.
    order = np.argsort(time_ns, kind="stable")
    cameras = [camera for part in parts for camera in part.camera]
    ids = [entry for part in parts for entry in part.ids]

    def joined(name: str) -> np.ndarray:
        return np.concatenate([getattr(part, name) for part in parts])[order]

    return Sightings(
        finger,
        time_ns[order],
        joined("position"),
        joined("rotation"),
        joined("covariance"),
        joined("ambiguous"),
        tuple(cameras[k] for k in order),
        tuple(ids[k] for k in order),
        joined("timing"),
        {name: error for name in rig.worlds if (error := _error_of(name, rig)) is not None},
    )


def repeated(view: TagStream) -> np.ndarray:
    """Return which poses of a finger are those of an image before, to the last bit, shape (p,), bool.

    Noise makes every image another one, of resting fingers too. So such an image is no new one, whatever its time.
    """
    poses = np.concatenate([view.position, view.quaternion], axis=1)
    again = np.asarray(np.isfinite(poses).all(axis=1))
    again[np.unique(poses, axis=0, return_index=True)[1]] = False
    return again


def _error_of(camera: str, rig: DemoRig) -> CameraError | None:
    """Return the error common to all sightings of a camera; None if its file states no uncertainty."""
    world = rig.worlds[camera]
    return None if world.spread is None else CameraError(world.matrix[:3, 3], world.spread)


def _of_camera(view: TagStream, rig: DemoRig, timing: float) -> Sightings:
    from scipy.spatial.transform import Rotation

    pose = rig.camera_pose(view.camera)
    sightings = np.isfinite(view.position).all(axis=1) & (view.faces > 0)
    # A rotation of no length or no number is no pose: one damaged message must not end the whole path.
    sightings &= (np.abs(np.linalg.norm(view.quaternion, axis=1) - 1) < UNIT) & ~repeated(view)
    if pose is None:
        sightings[:] = False
        pose = np.eye(4)
    indices, turn = np.flatnonzero(sightings), pose[:3, :3]
    count = len(indices)
    covariance = np.full((count, 6, 6), np.nan) if view.covariance is None else view.covariance[sightings].copy()
    # Rotation error and position both turn from the camera's frame into the world's.
    rotation = np.kron(np.eye(2), turn)
    covariance = rotation @ np.where(np.isfinite(covariance), covariance, np.nan) @ rotation.T
    lost = ~np.isfinite(covariance).all(axis=(1, 2))
    # A sighting without a stated error still counts, as one that errs widely.
    covariance[lost] = _diagonal(*UNKNOWN)
    # A matrix with a negative variance is of a damaged message.
    covariance[np.linalg.eigvalsh(covariance)[:, 0] < -ROUNDING] = _diagonal(*UNKNOWN)
    sigma = np.hypot(timing, np.zeros(count) if view.timing is None else view.timing[sightings])
    stamps = view.sample_ns[sightings]
    covariance[:, 3:, 3:] += displaced(stamps, view.position[sightings] @ turn.T, stamps, sigma)
    ambiguous = np.zeros(len(sightings), bool) if view.ambiguous is None else view.ambiguous
    ids: list[tuple[int, ...]] = list(view.ids) if view.ids else [()] * len(sightings)
    matrices = Rotation.from_quat(view.quaternion[sightings]).as_matrix() if count else np.zeros((0, 3, 3))
    return Sightings(
        view.finger,
        view.sample_ns[sightings],
        view.position[sightings] @ turn.T + pose[:3, 3],
        turn @ matrices,
        covariance + _diagonal(*FLOOR),
        ambiguous[sightings],
        (view.camera,) * count,
        tuple(ids[k] for k in indices),
        sigma,
    )


def displaced(time_ns: np.ndarray, position: np.ndarray, at_ns: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Return the covariance [m^2] that an uncertainty of time causes in a place, shape (n, 3, 3).

    It is the largest distance that a finger goes in once or twice that time, before or after. At a turning point its
    speed is 0 and that distance is not.

    Args:
        time_ns: Times of a finger's sightings by one camera [ns], shape (p,), ascending.
        position: Its places [m], shape (p, 3).
        at_ns: Times [ns], shape (n,).
        sigma: Standard uncertainty of each [s], shape (n,).
    """
    if len(time_ns) < 2:
        return np.zeros((len(at_ns), 3, 3))
    seconds, at = (time_ns - time_ns[0]) * 1e-9, (at_ns - time_ns[0]) * 1e-9

    def place(moments: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(moments, seconds, position[:, k]) for k in range(3)], axis=1)

    # Within one and two standard deviations of time the finger may have reversed, so both sides are asked.
    reach = np.minimum(sigma, LONGEST)
    away = np.stack([(place(at + s * reach) - place(at)) / abs(s) for s in (-2.0, -1.0, 1.0, 2.0)])
    squares = (away**2).sum(axis=2)
    outer = np.einsum("sni,snj->nij", away, away)
    return outer * (squares.max(axis=0) / np.maximum(squares.sum(axis=0), 1e-30))[:, None, None]


def _diagonal(position: float, rotation: float) -> np.ndarray:
    return np.diag([rotation**2] * 3 + [position**2] * 3)
