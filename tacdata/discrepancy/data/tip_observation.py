"""Where a camera, or a second gauge, saw the tip: laid onto the commanded path, episode by episode.

How camera and guide lie to each other is not known, so that a rotation and an offset for a whole session are fitted;
the remainder is the guide's deviation from its commands. A constant error of place is lost by that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.recording import Episode

FEWEST_VIEWS = 30
"""Registration: fewer views of a session register no camera."""
NEAR_NS = 150_000_000
"""A reading farther from any view has none [ns]."""
SHORTEST_WAY = 0.3
"""Registration: motion whose second direction is shorter fixes no rotation, only the depth [mm]."""
TRIM_Z = 4.0
"""Registration: views farther off are left out of the fit [robust standard deviations]."""
GAUGES = ("tag", "displacement", "height", "laser", "gauge", "encoder")
"""Words in the names of measured lengths that are a second observation of the depth."""


@dataclass(frozen=True)
class Views:
    """One episode's second observation."""

    time_ns: np.ndarray
    """Times of the views [ns], shape (p,), int64, increasing."""
    tip: np.ndarray
    """x, y, depth [mm], shape (p, 3); NaN where not known."""

    def at(self, time_ns: np.ndarray) -> np.ndarray:
        """Return the observed positions at times [ns], shape (n, 3): linear between views, NaN far from any."""
        result = np.stack([np.interp(time_ns, self.time_ns, column) for column in self.tip.T], axis=-1)
        upper = np.clip(np.searchsorted(self.time_ns, time_ns), 1, len(self.time_ns) - 1)
        distance = np.minimum(np.abs(time_ns - self.time_ns[upper - 1]), np.abs(time_ns - self.time_ns[upper]))
        result[distance > NEAR_NS] = np.nan
        return result


def second_views(episodes: list[Episode]) -> dict[int, Views]:
    """Return the observations of the tip by episodes of a session, by their place in the list; none if too few."""
    raw = {k: observations for k, e in enumerate(episodes) if (observations := _seen(e)) is not None}
    if sum(len(time) for time, _ in raw.values()) < FEWEST_VIEWS:
        return {}
    commanded = np.concatenate([_right_handed(episodes[k].tip_at(time)) for k, (time, _) in raw.items()])
    observations = np.concatenate([place for _, place in raw.values()])
    turn, offset = _laid_on(observations, commanded)
    result = {}
    for k, (time, place) in raw.items():
        laid = _right_handed(place @ turn.T + offset)
        if np.linalg.matrix_rank(turn) < 3:
            laid[:, :2] = np.nan
        result[k] = Views(time, laid)
    return result


def _seen(episode: Episode) -> tuple[np.ndarray, np.ndarray] | None:
    """Return times [ns] and places [mm] of the stream that saw most; a gauge's lengths stand in the third column."""
    streams = []
    for tags in episode.tags:
        good = (tags.faces > 0) & np.isfinite(tags.position).all(axis=1)
        good &= True if tags.ambiguous is None else ~tags.ambiguous
        streams.append((tags.sample_ns[good], tags.position[good] * 1e3))
    for stream in episode.measured:
        if stream.unit == "mm" and any(word in stream.name for word in GAUGES):
            good = np.isfinite(stream.values[:, 0])
            length = np.zeros((int(good.sum()), 3))
            length[:, 2] = stream.values[good, 0]
            streams.append((stream.sample_ns[good], length))
    best = max(streams, key=lambda item: len(item[0]), default=None)
    if best is None or len(best[0]) < 2:
        return None
    order = np.argsort(best[0], kind="stable")
    time, place = best[0][order], best[1][order]
    # `Views.at` interpolates and needs times that increase: a camera may report one frame twice.
    new = np.concatenate([[True], np.diff(time) > 0])
    return time[new], place[new]


def _right_handed(tip: np.ndarray) -> np.ndarray:
    # x, y and depth are left-handed, as depth counts downwards. A rotation can only map right-handed frames.
    return tip * np.array([1.0, 1.0, -1.0])


def _laid_on(observed: np.ndarray, commanded: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rotation (3, 3) and offset (3,) that lay one set of points onto another, trimmed (Kabsch 1976).

    Motion along one line fixes no rotation: the third row is then the line's direction, and the others are 0.
    """
    inliers = np.ones(len(observed), dtype=bool)
    turn, offset = np.eye(3), np.zeros(3)
    for _ in range(4):
        a, b = observed[inliers].mean(axis=0), commanded[inliers].mean(axis=0)
        cross = (observed[inliers] - a).T @ (commanded[inliers] - b)
        width = np.sqrt(np.linalg.eigvalsh(np.cov((commanded[inliers] - b).T))[-2])
        flat = np.count_nonzero(np.ptp(observed[inliers], axis=0) > 1e-9) < 2
        if width < SHORTEST_WAY or flat:
            line = cross[:, 2] / max(float(np.linalg.norm(cross[:, 2])), 1e-12)
            turn = np.stack([np.zeros(3), np.zeros(3), line])
        else:
            u, _, vt = np.linalg.svd(cross)
            # Without the sign, noise in a nearly flat path would give a reflection.
            sign = np.sign(np.linalg.det(vt.T @ u.T))
            turn = vt.T @ np.diag([1.0, 1.0, sign]) @ u.T
        offset = b - turn @ a
        distance = np.abs((observed @ turn.T + offset - commanded)[:, 2])
        usual = 1.4826 * float(np.median(distance[inliers]))
        inliers = distance <= max(TRIM_Z * usual, 1e-6)
    return turn, offset
