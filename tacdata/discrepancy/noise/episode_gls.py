"""Generalized least squares (GLS) with random errors of each episode.

The covariance of an episode's whitened rows is 1 + A A' + T T'. A is its own offset of every stream. T holds its errors
of pose, which all streams share, and its gain error of each stream. Columns are multiplied by the root of the inverse,
so that inner products are those of GLS (Aitken 1935). The inverse is Woodbury's: only small matrices are inverted.
Features that are free are projected out afterwards.

An episode's gain errors have mean zero, weighted by information: a common change of all streams is an error of depth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

RIDGE = 1e-7
"""Ridge of unexcited directions, over the mean of the excited ones [1]."""
MOST_TOGETHER = 40
"""Most episodes of a place whose scores are computed together: the cost grows with the cube."""


@dataclass(frozen=True)
class EpisodeErrorModel:
    """Per-episode random effects (offset, pose, gain) at one place, whitened; first axis: stream."""

    offset: np.ndarray
    """A constant [1], shape (streams, n)."""
    prior: np.ndarray
    """Its standard deviation in each episode, in noise scales [1], shape (episodes,); inf leaves it free."""
    gain_error: np.ndarray | None = None
    """Effect of one standard deviation of a stream's own gain [1], shape (streams, n)."""
    pose_errors: np.ndarray | None = None
    """Effect of one standard deviation of each error of pose [1], shape (streams, n, kinds)."""
    features: np.ndarray | None = None
    """Columns common to all episodes, each stream by itself [1], shape (streams, n, p); (1, n, p) where they,
    and the offsets, are equal in all streams."""
    random_walk: np.ndarray | None = None
    """Effect of one standard deviation of each mode of a stream's random walk [1], shape (streams, n, modes)."""


@dataclass(frozen=True)
class JointScores:
    """Score vector and information matrix of episode-specific columns."""

    episodes: np.ndarray
    """Numbers of the episodes, shape (n,), int64."""
    score: np.ndarray
    """Products of the columns with the residual [1], shape (n, k)."""
    information: np.ndarray
    """Products of the columns, episode by episode [1], shape (n k, n k)."""


class FactoredErrors:
    """Factored covariance of the episodes of one place: whitens any columns."""

    def __init__(
        self, spans: Sequence[slice], model: EpisodeErrorModel, reference: FactoredErrors | None = None
    ) -> None:
        """Factor the error covariance of episodes, each given by its rows.

        Args:
            spans: Rows of each episode.
            model: Their random effects.
            reference: Errors with the same offsets and random walks, which are not factored again.
        """
        gain_error = None if model.gain_error is None else model.gain_error[:, :, None]
        parts = {"pose": model.pose_errors, "gain": gain_error}
        arrays = {name: value for name, value in parts.items() if value is not None}
        edges = np.cumsum([value.shape[2] for value in arrays.values()])[:-1]
        stacked = np.concatenate([*arrays.values()], axis=2) if arrays else None
        self._free = None if model.features is None else _Free(len(model.offset), model.features.shape[2])
        self._episodes: list[tuple[slice, _Offsets, _Errors]] = []
        cache = [None] * len(spans) if reference is None else [offsets for _, offsets, _ in reference._episodes]
        for rows, prior, entry in zip(spans, model.prior, cache, strict=True):
            modes = None if model.random_walk is None else model.random_walk[:, rows]
            offsets, roots = entry or _Offsets(model.offset[:, rows, None], float(prior), modes), {}
            if stacked is not None:
                roots = dict(zip(arrays, np.split(offsets.rooted(stacked[:, rows]), edges, axis=2), strict=True))
            errors = _Errors(len(model.offset), rows.stop - rows.start, roots.get("pose"), roots.get("gain"))
            self._episodes.append((rows, offsets, errors))
            if self._free is not None and model.features is not None:
                self._free.take(offsets.rooted(model.features[:, rows]), errors)
        if self._free is not None:
            self._free.factor()

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the features, all streams together [1]."""
        return 0.0 if self._free is None else self._free.freedom

    def take_out(self, columns: np.ndarray) -> None:
        """Whiten columns in place for generalized least squares.

        Args:
            columns: Whitened, shape (streams, n, k).
        """
        for rows, offsets, errors in self._episodes:
            block = columns[:, rows]
            block -= offsets.part(block)
            block -= errors.part(block)
        self.project(columns)

    def project(self, white: np.ndarray) -> None:
        """Remove the features' part of whitened noise, in place: white (streams, n, k)."""
        if self._free is None:
            return
        weights = self._free.weights([white[:, rows] for rows, _, _ in self._episodes])
        for k, (rows, _, _) in enumerate(self._episodes):
            white[:, rows] -= self._free.fitted(k, weights)

    def joint_scores(self, residual: np.ndarray, columns: np.ndarray) -> list[JointScores]:
        """Return scores and information of columns of which each episode has its own, episodes of a run together.

        Args:
            residual: A residual, as `without` returns it, shape (streams, n).
            columns: Whitened, shape (streams, n, k).
        """
        runs = []
        for first in range(0, len(self._episodes), MOST_TOGETHER):
            scores, powers, rights = [], [], []
            for k, (rows, offsets, errors) in enumerate(self._episodes[first : first + MOST_TOGETHER], first):
                rooted_columns, segment = offsets.rooted(columns[:, rows]), residual[:, rows]
                inner = errors.inner(rooted_columns)
                solution = np.linalg.solve(np.eye(len(errors.gram)) + errors.gram, inner)
                pull = errors.root @ errors.inner(segment[:, :, None])[:, 0]
                scores.append(np.einsum("smk,sm->k", rooted_columns, segment, dtype=np.float64) - inner.T @ pull)
                flat = rooted_columns.reshape(-1, rooted_columns.shape[2]).astype(np.float64)
                powers.append(flat.T @ flat - inner.T @ solution)
                if self._free is not None:
                    rights.append(self._free.right(k, rooted_columns, solution))
            information = block_diag(*powers)
            if self._free is not None:
                information = information - self._free.taken_of_all(np.concatenate(rights, axis=2))
            runs.append(JointScores(np.arange(first, first + len(scores)), np.array(scores), information))
        return runs

    def stream_scores(self, residual: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return scores and information of columns that each stand in one stream of one episode.

        Like the products with the columns that `without` returns, but for streams times episodes of them at once.
        Streams must not have gains of their own as well.

        Args:
            residual: A residual, as `without` returns it, shape (streams, n).
            columns: The columns of all streams and episodes, whitened, shape (streams, n).

        Returns:
            Scores and information, shapes (episodes, streams).
        """
        scores, information = [], []
        for k, (rows, offsets, errors) in enumerate(self._episodes):
            rooted_columns, segment = offsets.rooted(columns[:, rows, None])[:, :, 0], residual[:, rows]
            pose = errors.of_each(rooted_columns)
            pull = errors.root @ errors.inner(segment[:, :, None])[:, 0]
            solution = pose @ np.linalg.inv(np.eye(len(errors.gram)) + errors.gram)
            scores.append(np.einsum("sm,sm->s", rooted_columns, segment) - pose @ pull)
            power = np.einsum("sm,sm->s", rooted_columns, rooted_columns) - np.einsum("sk,sk->s", solution, pose)
            information.append(power if self._free is None else power - self._free.taken(k, rooted_columns, solution))
        return np.array(scores), np.array(information)


class _Offsets:
    """One episode's own offset of every stream, and how it goes on within the episode."""

    def __init__(self, offset: np.ndarray, prior: float, random_walk: np.ndarray | None = None) -> None:
        """Take a constant (streams, m, 1), its standard deviation, and modes of a random walk (streams, m, k)."""
        modes = offset[:, :, :0] if random_walk is None else random_walk
        if np.isinf(prior):
            # A free offset is projected out. The modes are made orthogonal to it, else each would free a part of
            # itself, too.
            constant = offset / np.sqrt(np.maximum(np.square(offset).sum(axis=1, keepdims=True), 1e-12))
            modes = modes - constant @ (constant.transpose(0, 2, 1) @ modes)
        else:
            constant = prior * offset
        self._columns = np.concatenate([constant, modes], axis=2)
        transposed = self._columns.transpose(0, 2, 1)
        root = _root(transposed.astype(np.float64) @ self._columns)
        if np.isinf(prior):  # unpenalized directions are projected out
            root[:, 0], root[:, :, 0] = 0.0, 0.0
            root[:, 0, 0] = 1.0
        self._pull = (root @ transposed).astype(np.float32)

    def part(self, block: np.ndarray) -> np.ndarray:
        """Return the correction to subtract from columns (streams, m, k) to account for it."""
        return self._columns[: len(block)] @ (self._pull[: len(block)] @ block)

    def rooted(self, block: np.ndarray) -> np.ndarray:
        """Return columns (streams or the first, m, k) with it accounted for."""
        return block - self.part(block)


def _root(gram: np.ndarray) -> np.ndarray:
    """Return M of 1 - T M T', the root of the inverse of 1 + T T', for T'T, shape (..., k, k)."""
    values, vectors = np.linalg.eigh(gram.astype(np.float64))
    size = np.sqrt(1 + np.maximum(values, 0.0))
    return (vectors / (size * (size + 1))[..., None, :]) @ np.swapaxes(vectors, -1, -2)


class _Errors:
    """One episode's errors of pose and gain, T: kinds of pose, then a gain a stream."""

    def __init__(self, streams: int, rows: int, pose: np.ndarray | None, gain_error: np.ndarray | None) -> None:
        arrays = [part for part in (pose, gain_error) if part is not None]
        # Part of a stream in each of T's columns that are not another stream's: pose, then its own gain.
        self._own = np.concatenate([np.zeros((streams, rows, 0), dtype=np.float32), *arrays], axis=2)
        self._kinds = 0 if pose is None else pose.shape[2]
        self._mean = None
        columns = self._own[:, :, : self._kinds]
        if gain_error is not None:
            power = np.square(gain_error).sum(axis=(1, 2)).astype(np.float64)
            # A gain common to all streams is an error of pose or load and has its own column. Gains of streams are
            # deviations from it.
            self._mean = power / max(float(power.sum()), 1e-12)
            gains = gain_error * (np.eye(streams) - self._mean)[:, None, :].astype(np.float32)
            columns = np.concatenate([columns, gains], axis=2)
        self.gram = self.inner(columns)
        # The Gram matrix is symmetric only up to rounding, and `eigh` reads one triangle of it.
        self.root = _root(0.5 * (self.gram + self.gram.T))

    def inner(self, block: np.ndarray) -> np.ndarray:
        """Return T' of columns (streams, m, k), shape (kinds + streams, k)."""
        each = (self._own.transpose(0, 2, 1) @ block).astype(np.float64)
        pose = each[:, : self._kinds].sum(axis=0)
        if self._mean is None:
            return pose
        gain = each[:, self._kinds]
        return np.concatenate([pose, gain - self._mean[:, None] * gain.sum(axis=0)])

    def of_each(self, columns: np.ndarray) -> np.ndarray:
        """Return T' of columns that each stand in one stream alone, shape (streams, m): shape (streams, kinds)."""
        return np.einsum("smk,sm->sk", self._own[:, :, : self._kinds], columns, dtype=np.float64)

    def joint(self, shared: np.ndarray) -> np.ndarray:
        """Return T' of columns (streams, m, p), each in one stream alone, shape (streams, p, kinds + streams)."""
        each = shared.transpose(0, 2, 1) @ self._own
        if self._mean is None:
            return each.astype(np.float64)
        gain = each[:, :, self._kinds :] * (np.eye(len(each)) - self._mean)[:, None, :]
        return np.concatenate([each[:, :, : self._kinds], gain], axis=2).astype(np.float64)

    def times(self, weights: np.ndarray) -> np.ndarray:
        """Return T weights, shape (streams, m, k), for weights of shape (kinds + streams, k)."""
        stacked = np.repeat(weights[None, : self._kinds], len(self._own), axis=0)
        if self._mean is not None:
            gain = weights[self._kinds :]
            stacked = np.concatenate([stacked, (gain - self._mean @ gain)[:, None]], axis=1)
        return self._own @ stacked.astype(np.float32)

    def part(self, block: np.ndarray) -> np.ndarray:
        """Return the correction of columns (streams, m, k) that multiplies them by (1 + T T')^-1/2."""
        return self.times(self.root @ self.inner(block))


class _Free:
    """Features of one place: normal equations, a block a stream, joined by the episodes' own errors."""

    def __init__(self, streams: int, width: int) -> None:
        self._streams, self._blocks = streams, np.zeros((1, width, width))
        self._shared: list[np.ndarray] = []
        self._joints: list[np.ndarray] = []
        self._errors: list[_Errors] = []

    def take(self, shared: np.ndarray, errors: _Errors) -> None:
        """Take an episode's features in, shape (streams, m, p), or (1, m, p) where streams are equal."""
        exact = shared.astype(np.float64)  # splines of few rows are nearly collinear: single precision loses their rank
        self._blocks = self._blocks + exact.transpose(0, 2, 1) @ exact
        shared = np.broadcast_to(shared, (self._streams, *shared.shape[1:]))
        self._shared.append(shared)
        self._joints.append(errors.joint(shared))
        self._errors.append(errors)

    def factor(self) -> None:
        """Invert the part common to all columns."""
        streams, width = self._streams, self._blocks.shape[1]
        mean = np.einsum("spp->s", self._blocks) / width
        # A spline that no row of the place reaches would leave its block singular.
        floor = RIDGE * np.maximum(mean, 1e-12)[:, None, None] * np.eye(width)
        inverse = np.linalg.inv(self._blocks + floor)
        self.freedom = float(np.einsum("sij,sji->", inverse, self._blocks)) * streams / len(inverse)
        self._inverse = np.broadcast_to(inverse, (streams, width, width))
        joint = np.concatenate(self._joints, axis=2)
        self._through = self._inverse @ joint
        self._joint = joint.reshape(streams * width, -1)
        matrix = -self._joint.T @ self._through.reshape(self._joint.shape)
        at = 0
        for errors in self._errors:
            count = len(errors.gram)
            matrix[at : at + count, at : at + count] += np.eye(count) + errors.gram
            at += count
        self._inner = np.linalg.inv(matrix)

    def weights(self, residuals: list[np.ndarray]) -> np.ndarray:
        """Return the weights that fit best, shape (streams, p, k), to the columns of each episode (streams, m, k)."""
        right = np.zeros((*self._inverse.shape[:2], residuals[0].shape[2]))
        for shared, joint, errors, block in zip(self._shared, self._joints, self._errors, residuals, strict=True):
            right += (shared.transpose(0, 2, 1) @ block).astype(np.float64) - joint @ (
                errors.root @ errors.inner(block)
            )
        return self._solved(right)

    def _solved(self, right: np.ndarray) -> np.ndarray:
        """Return the solution of the normal equations, shape (streams, p, k)."""
        local = self._inverse @ right
        if not self._joint.shape[1]:
            return local
        pull = self._joint.T @ local.reshape(len(self._joint), -1)
        return local + self._through @ (self._inner @ pull)

    def right(self, episode: int, columns: np.ndarray, solution: np.ndarray) -> np.ndarray:
        """Return products of features and an episode's columns (streams, m, k), (streams, p, k); solution (T, k)."""
        product = (self._shared[episode].transpose(0, 2, 1) @ columns).astype(np.float64)
        return product - self._joints[episode] @ solution

    def taken_of_all(self, right: np.ndarray) -> np.ndarray:
        """Return the information that features absorb, shape (k, k); ``right``: products with them (streams, p, k)."""
        return np.einsum("spk,spl->kl", right, self._solved(right), optimize=True)

    def taken(self, episode: int, columns: np.ndarray, solution: np.ndarray) -> np.ndarray:
        """Return the information of columns in one stream of an episode that features absorb, shape (streams,).

        Args:
            episode: Its number.
            columns: The columns, shape (streams, m).
            solution: (1 + T'T)^-1 T' of each, shape (streams, kinds).
        """
        joint = self._joints[episode]
        projection = np.einsum("smp,sm->sp", self._shared[episode], columns, dtype=np.float64)
        through = np.einsum("sp,spt->st", projection, self._through)
        inside = np.einsum("sp,spq,sq->s", projection, self._inverse, projection)
        inside += np.einsum("st,tu,su->s", through, self._inner, through)
        pose = self._inverse @ joint
        pose += self._through @ (self._inner @ np.einsum("spt,spk->tk", self._through, joint))
        inside -= 2 * np.einsum("sp,spk,sk->s", projection, pose, solution)
        return inside + np.einsum("sk,kl,sl->s", solution, np.einsum("spk,spl->kl", joint, pose), solution)

    def fitted(self, episode: int, weights: np.ndarray) -> np.ndarray:
        """Return an episode's change by weights, shape (streams, m, k)."""
        errors, joint = self._errors[episode], self._joints[episode]
        flat = joint.reshape(joint.shape[0] * joint.shape[1], joint.shape[2])
        through = errors.root @ (flat.T @ weights.reshape(len(flat), -1))
        return self._shared[episode] @ weights.astype(np.float32) - errors.times(through)
