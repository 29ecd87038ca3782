"""Fixed-interval smoothing of a pose: an error-state Kalman filter forward, Rauch-Tung-Striebel backward.

State: position p [m], rotation R, velocity v [m/s], angular velocity w [rad/s, world]. Between two times p' = p + v dt,
R' = exp(w dt) R. v and w change as integrated white noise: a constant-velocity model (Bar-Shalom, Li and
Kirubarajan, Estimation with Applications to Tracking and Navigation, section 6.2). Errors are a small rotation in the
world, dp, dw, dv in this order. So a rotation never leaves SO(3), and a sighting's covariance is used as it is.

Where a camera's own place is known with a standard deviation, its error is a state too: a rotation and a translation,
constant in time. Averaging many sightings does not make it smaller, as it would if it were noise of each sighting.

The backward pass is H. E. Rauch, F. Tung, C. T. Striebel, AIAA Journal 3 (1965) 1445, on those errors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from tacdata.demonstrations.paths.sightings import Sightings

GATE = 27.9
"""Gate: squared Mahalanobis distance in six dimensions beyond which a sighting is an outlier (chi-squared, 0.9999)."""
FIRST_SPEED = 1.0, 10.0
"""Prior standard deviation of the velocity [m/s] and angular velocity [rad/s]."""
GAP = 0.25
"""Time without a sighting that counts as a gap [s]."""
MOTION = 12
"""States of the motion itself; those of the cameras follow [1]."""
NS = 1e-9


@dataclass(frozen=True)
class ProcessNoise:
    """Process noise of a finger's motion."""

    velocity: float
    """Spectral density of the white acceleration [(m/s^2)^2 s]."""
    turning: float
    """Spectral density of the white angular acceleration [(rad/s^2)^2 s]."""
    unseen: ProcessNoise | None = None
    """The same over a gap, where a fast motion goes unnoticed; None for no other."""


MANOEUVRE = ProcessNoise(100.0, 10_000.0)
"""Process noise of the most abrupt motion of a hand, for the step before a track is resumed."""


@dataclass(frozen=True, eq=False)
class Smoothed:
    """A smoothed pose at every requested time."""

    position: np.ndarray
    """Position [m], shape (n, 3)."""
    rotation: np.ndarray
    """From the finger's frame to the world's [1], shape (n, 3, 3)."""
    covariance: np.ndarray
    """Covariance of a small rotation in the world [rad] and the position [m], shape (n, 6, 6)."""
    velocity: np.ndarray
    """Velocity [m/s], shape (n, 3)."""
    accepted: np.ndarray
    """Which sightings were used, shape (p,), bool; the others are outliers."""
    distance: np.ndarray
    """Squared Mahalanobis distance of each sighting from its prediction [1], shape (p,)."""
    log_likelihood: float
    """Log-likelihood of the sightings; an outlier counts as one at the gate."""


@dataclass(eq=False)
class _Node:
    """One time: the predicted and the updated state."""

    expected: _State
    spread: np.ndarray
    step: np.ndarray
    state: _State
    known: np.ndarray


_EYE, _EYE6 = np.eye(3), np.eye(6)  # made once: a step takes a dozen


@dataclass(frozen=True, eq=False)
class _State:
    rotation: np.ndarray
    position: np.ndarray
    turning: np.ndarray
    velocity: np.ndarray
    cameras: np.ndarray
    """Rotation [rad] and translation [m] of each camera against its file, shape (6 k,)."""

    def plus(self, error: np.ndarray) -> _State:
        return _State(
            exponential(error[:3]) @ self.rotation,
            self.position + error[3:6],
            self.turning + error[6:9],
            self.velocity + error[9:MOTION],
            self.cameras + error[MOTION:],
        )

    def minus(self, reference: _State) -> np.ndarray:
        turn = logarithm(self.rotation @ reference.rotation.T)
        differences = (
            self.position - reference.position,
            self.turning - reference.turning,
            self.velocity - reference.velocity,
        )
        return np.concatenate([turn, *differences, self.cameras - reference.cameras])


def smooth(
    sightings: Sightings,
    times_ns: np.ndarray,
    wander: ProcessNoise,
    back: bool = True,
    reacquired: Sequence[int] = (),
    left_out: Sequence[int] = (),
) -> Smoothed:
    """Return the pose at given times.

    Args:
        sightings: At least two sightings.
        times_ns: Times [ns], shape (n,), ascending; poses outside the sightings' span are NaN.
        wander: Process noise: how freely the finger moves.
        back: Whether to smooth backward; without it poses depend on the past only.
        reacquired: Sightings before which the finger may have moved as in `MANOEUVRE`.
        left_out: Sightings that are outliers however well they fit.

    Returns:
        Poses, and which sightings were used.
    """
    again, wrong = set(reacquired), set(left_out)
    first = _beginning(sightings)
    inside = (times_ns >= sightings.time_ns[first]) & (times_ns <= sightings.time_ns[-1])
    moments = np.concatenate([sightings.time_ns[first:], times_ns[inside]])
    which = np.concatenate([np.arange(first, len(sightings)), np.full(int(inside.sum()), -1)])
    # Of one time, sightings come before the pose that is asked for, which then contains them.
    order = np.lexsort((which < 0, moments))
    accepted, distance, likelihood, nodes = np.zeros(len(sightings), bool), np.full(len(sightings), np.nan), 0.0, []
    state, covariance, instant = _first(sightings, first)
    unseen = _over_gaps(sightings, moments)
    for k in order:
        # Where a track is resumed the finger may have gone anywhere since; over gaps, as far as elsewhere in that time.
        freely = MANOEUVRE if int(which[k]) in again else (wander.unseen or wander) if unseen[k] else wander
        expected, spread, step = _predicted(state, covariance, float(moments[k] - instant) * NS, freely)
        state, covariance, instant = expected, spread, moments[k]
        if which[k] >= 0:
            n = int(which[k])
            state, covariance, distance[n], gained = _updated(expected, spread, sightings, n, n in wrong)
            accepted[n] = distance[n] < GATE and n not in wrong
            likelihood += gained
        nodes.append(_Node(expected, spread, step, state, covariance))
    if back:
        _go_back(nodes)
    poses = [node for node, k in zip(nodes, order, strict=True) if which[k] < 0]
    return _collected(poses, inside, accepted, distance, likelihood)


def _over_gaps(sightings: Sightings, moments: np.ndarray) -> np.ndarray:
    """Return which moments [ns] lie in a gap between sightings, or at its end, shape (n,), bool."""
    upper = np.clip(np.searchsorted(sightings.time_ns, moments), 1, len(sightings) - 1)
    return sightings.time_ns[upper] - sightings.time_ns[upper - 1] > GAP / NS


def _collected(
    poses: list[_Node], inside: np.ndarray, accepted: np.ndarray, distance: np.ndarray, likelihood: float
) -> Smoothed:
    count = len(inside)
    result = {
        "position": np.full((count, 3), np.nan),
        "rotation": np.full((count, 3, 3), np.nan),
        "covariance": np.full((count, 6, 6), np.nan),
        "velocity": np.full((count, 3), np.nan),
    }
    for row, node in zip(np.flatnonzero(inside), poses, strict=True):
        result["position"][row], result["rotation"][row] = node.state.position, node.state.rotation
        result["covariance"][row], result["velocity"][row] = node.known[:6, :6], node.state.velocity
    return Smoothed(**result, accepted=accepted, distance=distance, log_likelihood=likelihood)


def _beginning(sightings: Sightings) -> int:
    """Return the first sighting that the next two do not contradict: a path must not begin with a mirrored pose."""
    for k in range(min(len(sightings) - 2, 20)):
        near = [
            np.linalg.norm(logarithm(sightings.rotation[k] @ sightings.rotation[j].T)) < 0.5
            and np.linalg.norm(sightings.position[k] - sightings.position[j]) < 0.05
            for j in (k + 1, k + 2)
        ]
        if all(near):
            return k
    return 0


def _first(sightings: Sightings, k: int) -> tuple[_State, np.ndarray, int]:
    errors = [error.spread for error in sightings.cameras.values()]
    size = MOTION + 6 * len(errors)
    covariance = np.zeros((size, size))
    covariance[:6, :6] = 100 * sightings.covariance[k]  # its own sighting comes next and must not count twice
    covariance[6:9, 6:9], covariance[9:MOTION, 9:MOTION] = FIRST_SPEED[1] ** 2 * _EYE, FIRST_SPEED[0] ** 2 * _EYE
    for number, (position, rotation) in enumerate(errors):
        at = MOTION + 6 * number
        covariance[at : at + 3, at : at + 3] = rotation**2 * _EYE
        covariance[at + 3 : at + 6, at + 3 : at + 6] = position**2 * _EYE
        # The first pose errs with the camera that saw it.
        covariance[:6, :6] += np.diag([rotation**2] * 3 + [position**2] * 3)
    first = _State(sightings.rotation[k], sightings.position[k], np.zeros(3), np.zeros(3), np.zeros(size - MOTION))
    return first, covariance, int(sightings.time_ns[k])


def _predicted(
    state: _State, covariance: np.ndarray, dt: float, wander: ProcessNoise
) -> tuple[_State, np.ndarray, np.ndarray]:
    turn = exponential(state.turning * dt)
    step = np.eye(len(covariance))
    # An error of rotation is a vector in the world: it turns along with the finger.
    step[:3, :3] = turn
    step[:3, 6:9] = step[3:6, 9:MOTION] = dt * _EYE
    of_rates, mixed, of_places = _noise_parts(len(covariance), wander.turning, wander.velocity)
    # Integrated white acceleration: the covariances of velocity, of both together, and of position.
    noise = dt * of_rates + dt**2 / 2 * mixed + dt**3 / 3 * of_places
    place = state.position + state.velocity * dt
    expected = _State(turn @ state.rotation, place, state.turning, state.velocity, state.cameras)
    return expected, step @ covariance @ step.T + noise, step


@lru_cache(maxsize=64)
def _noise_parts(size: int, turning: float, velocity: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the parts of the process noise proportional to dt, dt^2 / 2 and dt^3 / 3, each of shape (size, size)."""
    of_rates, mixed, of_places = (np.zeros((size, size)) for _ in range(3))
    for begin, density in ((0, turning), (3, velocity)):
        at, rate = slice(begin, begin + 3), slice(begin + 6, begin + 9)
        of_places[at, at] = of_rates[rate, rate] = mixed[at, rate] = mixed[rate, at] = density * _EYE
    return of_rates, mixed, of_places


def _updated(
    expected: _State, spread: np.ndarray, sightings: Sightings, n: int, wrong: bool
) -> tuple[_State, np.ndarray, float, float]:
    """Return state and covariance after a sighting, its squared distance and likelihood; an outlier changes neither."""
    surprise = np.concatenate(
        [logarithm(sightings.rotation[n] @ expected.rotation.T), sightings.position[n] - expected.position]
    )
    if sightings.cameras:
        seen_as = _observed(expected, sightings, n)
        # The cameras' errors are states: a constant error of a camera's place does not average out over its images.
        surprise = surprise - seen_as[:, MOTION:] @ expected.cameras
        cross = spread @ seen_as.T
        total = seen_as @ cross + sightings.covariance[n]
    else:  # a sighting shows the pose itself
        cross = spread[:, :6]
        total = cross[:6] + sightings.covariance[n]
    inverse = np.linalg.inv(total)
    distance = float(surprise @ inverse @ surprise)
    # An outlier counts as one at the gate. Without that, every rejection would make a track likelier.
    gained = -0.5 * ((GATE if wrong else min(distance, GATE)) + np.linalg.slogdet(total)[1])
    if wrong or distance >= GATE:
        return expected, spread, distance, gained
    gain = cross @ inverse
    covariance = spread - gain @ cross.T
    # Rounding would make the covariance unsymmetric over thousands of steps.
    return expected.plus(gain @ surprise), (covariance + covariance.T) / 2, distance, gained


def _observed(expected: _State, sightings: Sightings, n: int) -> np.ndarray:
    """Return the derivatives of a sighting's rotation and position by the state's errors, shape (6, 12 + 6 k)."""
    result = np.zeros((6, MOTION + 6 * len(sightings.cameras)))
    result[:, :6] = _EYE6
    if sightings.camera[n] in sightings.cameras:
        at = MOTION + 6 * list(sightings.cameras).index(sightings.camera[n])
        x, y, z = expected.position - sightings.cameras[sightings.camera[n]].place
        result[:, at : at + 6] = _EYE6
        # A rotation of the camera by e displaces its sightings by e x r.
        result[3:, at : at + 3] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    return result


def _go_back(nodes: list[_Node]) -> None:
    for k in range(len(nodes) - 2, -1, -1):
        node, successor = nodes[k], nodes[k + 1]
        # The smoother of Rauch, Tung and Striebel, on errors about each predicted state.
        gain = np.linalg.solve(successor.spread, successor.step @ node.known).T
        correction = gain @ successor.state.minus(successor.expected)
        covariance = node.known + gain @ (successor.known - successor.spread) @ gain.T
        node.state, node.known = node.state.plus(correction), (covariance + covariance.T) / 2


def exponential(vector: np.ndarray) -> np.ndarray:
    """Return the rotation matrix, shape (3, 3), of a rotation vector [rad], shape (3,) (Rodrigues)."""
    x, y, z = map(float, vector)
    angle = math.sqrt(x * x + y * y + z * z)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-8:
        # Series to second order: the quotients below become 0 over 0.
        return _EYE + cross + cross @ cross / 2
    return _EYE + math.sin(angle) / angle * cross + (1 - math.cos(angle)) / angle**2 * cross @ cross


def logarithm(matrix: np.ndarray) -> np.ndarray:
    """Return the rotation vector [rad], shape (3,), of a rotation matrix, shape (3, 3)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = matrix.tolist()
    axis = np.array([zy - yz, xz - zx, yx - xy])
    sine, cosine = math.hypot(zy - yz, xz - zx, yx - xy) / 2, (xx + yy + zz - 1) / 2
    angle = math.atan2(sine, cosine)
    if sine > 1e-4:
        return axis * (angle / (2 * sine))
    # At so small an angle its quotient with the sine is 1 to within 2e-9.
    if cosine > 0:
        return axis / 2
    from scipy.spatial.transform import Rotation

    # Near half a turn the sine vanishes, and the axis cannot be taken from it.
    return Rotation.from_matrix(matrix).as_rotvec()
