"""A response without memory fitted to the recordings themselves: for sensors that no model exists of."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csr_array

from tacdata.chain import Course, Response
from tacdata.discrepancy.model.contexts import contexts

EVEN_INTERVALS = 8
"""With so few intervals, knots stay evenly spaced."""
INTERVALS = 50
"""Most intervals of the splines in depth. The splines have no direction, rate or time, so they absorb no history,
however many they are. Too few cannot follow the first touch, and half of that error resembles adhesion. (Prediction of
left-out episodes is no criterion: the bias is far below the noise of a reading, but significant over all of them.)"""
BENT = 0.65
"""Share of the knots that follow the response's curvature [1]."""
LITTLE = 0.02
"""Added to a reading where a bend is taken relative to it [largest reading]."""
ROWS_EACH = 4
"""Rows of a place that a spline must have at least."""
LEAST_SMOOTHING = 1e-5
"""Weight of bending where no row decides, over the mean diagonal [1]."""
RIDGE = 1e-8
"""Share of the mean diagonal added to it."""
BLOCK = 4
"""Rows of a mean by which noise is estimated: autocorrelation counts."""
REML_STEPS = 30
"""REML: steps to the weight of bending."""
MOST_SMOOTHING = 1e9
"""REML: largest weight of bending [1]."""
SLOPES = 10.0
"""REML: noise is taken for so many times its variance. A motion of the tip shows by slopes, which need more smoothing
than values do. The values that a smoother response misses are projected out [1]."""
INNER = (0.02, 0.98)
"""Quantiles of readings between which their range is taken: a few odd ones do not count [1]."""
CACHED = 6
"""Evaluations remembered: most effects leave the pose alone."""
FORM_ERROR = 0.15
"""Model error of every effect through it: transducers and sampling are not known [1]."""


class FittedResponse(Response):
    """Splines in depth for every place and tool; works on the rows of its own course."""

    fitted = True
    form_error = FORM_ERROR

    def __init__(self, course: Course, knots: int | None = None) -> None:
        """Lay out splines and fit them to the course's readings.

        Args:
            course: The recordings, without missing readings.
            knots: Most intervals of a spline, `INTERVALS` unless given.
        """
        self._course = course
        self._read = course.read
        reduced = course.reduced
        depth = reduced.tip[:, 2]  # the shallowest presses may have no readings
        quiet = depth <= max(0.0, float(course.tip[:, 2].min()) + 0.02 * course.stroke, float(depth.min()))
        self.idle = np.median(reduced.readings[quiet], axis=0)
        self.context = contexts(course)
        self._rows = [np.flatnonzero(self.context == k) for k in range(int(self.context.max()) + 1)]
        each = [reduced.readings[self._within(k)] for k in range(len(self._rows))]
        none = np.zeros(course.channels)
        self._swings = np.stack([np.ptp(np.quantile(y, INNER, axis=0), axis=0) if len(y) else none for y in each])
        streams = reduced.readings - self.idle
        self._has_force = course.force is not None
        if reduced.force is not None:
            rows, measured = np.arange(len(reduced.force)), np.isfinite(reduced.force)
            filled = np.interp(rows, rows[measured], reduced.force[measured]) if measured.any() else np.zeros(len(rows))
            streams = np.column_stack([streams, filled])
        self._shaken = np.zeros(streams.shape[1])
        count = knots or INTERVALS
        self._designs: list[tuple[np.ndarray, list[np.ndarray]]] = []
        self._answers: list[tuple[np.ndarray, np.ndarray]] = []
        self._bases = [self._basis(reduced.tip[self._within(k), 2], count) for k in range(self.context.max() + 1)]
        # Their value in the air: that is an offset of the place, which no history should go through.
        self._air = [self._design(basis, basis.t[:1]) for basis in self._bases]
        self._fit(streams)  # unsmoothed: its residual estimates the noise, which smoothing needs
        self._shaken = _shaken(streams - self._followed(), reduced)  # of blocks: correlated noise bends a spline more
        self._fit(streams)
        if count > EVEN_INTERVALS:
            self._bases = [self._bent(k, count) for k in range(len(self._bases))]
            self._air = [self._design(basis, basis.t[:1]) for basis in self._bases]
            self._fit(streams)

    def copied(self) -> FittedResponse:
        """Return the same response, to be corrected by itself."""
        twin = copy.copy(self)
        twin._weights, twin._designs, twin._answers = [*self._weights], [*self._designs], [*self._answers]
        return twin

    def of_place(self, context: int, course: Course) -> FittedResponse:
        """Return it for another course, all of it at one of its places and tools."""
        twin = copy.copy(self)
        twin._bases, twin._weights = [self._bases[context]], [self._weights[context]]
        twin._swings = self._swings[context : context + 1]
        twin._air = [self._air[context]]
        vars(twin).pop("air", None)  # that of all places
        twin.context, twin._rows = np.zeros(course.rows, dtype=np.int64), [np.arange(course.rows)]  # ty: ignore[invalid-assignment]
        twin._course, twin._read, twin._designs, twin._answers = course, np.arange(course.rows), [], []
        return twin

    def load(self, pose: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """Return readings above idle, shape (n, channels); rows must be the course's."""
        return self._both(pose)[:, : self._course.channels]

    def force(self, pose: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """Return the force as measured [N]; without one, the root mean square of the loads."""
        outputs = self._both(pose)
        return outputs[:, -1] if self._has_force else np.sqrt(np.mean(np.square(outputs), axis=1))

    def signal(self, load: np.ndarray) -> np.ndarray:
        """Return readings, shape (n, channels)."""
        return self.idle + load

    def swing(self, signal: np.ndarray) -> np.ndarray:
        """Return the range of each channel's readings at each row's place, whatever the splines hold of it."""
        return self._swings[self.context]

    def features(self, course: Course) -> np.ndarray:
        """Return the splines at the course's rows, shape (n, most splines of a place)."""
        result = np.zeros((course.rows, self.width))
        context = contexts(course)
        for k, basis in enumerate(self._bases):
            rows = context == k
            design = self._design(basis, course.tip[rows, 2])
            result[np.ix_(rows, np.arange(design.shape[1]))] = design
        return result

    def basis(self, pose: np.ndarray) -> np.ndarray:
        """Return the splines at poses of all rows of the course, shape (n, most splines of a place)."""
        result = np.zeros((len(pose), self.width))
        for k, design in enumerate(self._designs_at(pose)):
            result[self._rows[k], : design.shape[1]] = design
        return result

    @cached_property
    def air(self) -> np.ndarray:
        """Each spline's value in the air, at all rows of the course, shape (n, most splines of a place)."""
        result = np.zeros((len(self.context), self.width))
        for rows, air in zip(self._rows, self._air, strict=True):
            result[rows, : air.shape[1]] = air
        result.flags.writeable = False  # copies share it
        return result

    @property
    def width(self) -> int:
        """Splines of the place that has most."""
        return max(len(b.t) - b.k - 1 for b in self._bases)

    def correct(self, residual: np.ndarray, features: np.ndarray) -> None:
        """Add to the response the part of a residual that its splines can follow.

        Args:
            residual: Of the rows read, shape (m, channels), or one more with the force.
            features: Contribution of each spline to a reading in a model, shape (m, most splines of a place); to each
                stream, shape (m, streams, splines), where the force differs.
        """
        self._answers = []
        for k, of, _, more in self._corrections(residual, features):
            self._weights[k] = self._weights[k].copy()
            self._weights[k][:, of] += more

    def residual_after(self, residual: np.ndarray, features: np.ndarray) -> np.ndarray:
        """Return the residual after the next correction if effects were linear in load, shape (m, streams).

        Args:
            residual: As for `correct`.
            features: As for `correct`.
        """
        remainder = np.nan_to_num(residual)
        for k, of, block, more in self._corrections(residual, features):
            remainder[self._within(k), of] -= block @ more
        return remainder

    def _corrections(
        self, residual: np.ndarray, features: np.ndarray
    ) -> Iterator[tuple[int, slice, np.ndarray, np.ndarray]]:
        """Give places and streams with their features, shape (k, splines), and the increments of the weights there."""
        last = residual.shape[1] - 1
        parts = [slice(None)] if features.ndim == 2 else [slice(0, last), slice(last, None)]
        for k, basis in enumerate(self._bases):
            rows, count = self._within(k), len(basis.t) - basis.k - 1
            for of in parts:
                part = (features[rows] if features.ndim == 2 else features[rows, of.start])[:, :count]
                more, _ = self._solve(
                    rows, np.nan_to_num(residual[rows, of]), part, basis, self._smooth[k][of], self._weights[k][:, of]
                )
                yield k, of, part, more

    def _fit(self, streams: np.ndarray) -> None:
        depth, self._weights, self._smooth = self._course.reduced.tip[:, 2], [], []
        for k, basis in enumerate(self._bases):
            rows = self._within(k)
            weights, smooth = self._solve(rows, streams[rows], self._design(basis, depth[rows]), basis)
            self._weights.append(weights)
            self._smooth.append(smooth)

    def _followed(self) -> np.ndarray:
        """Return the splines' values at the rows read, shape (m, streams)."""
        depth = self._course.reduced.tip[:, 2]
        result = np.zeros((len(depth), self._weights[0].shape[1]))
        for k, (basis, weights) in enumerate(zip(self._bases, self._weights, strict=True)):
            rows = self._within(k)
            result[rows] = self._design(basis, depth[rows]) @ weights
        return result

    def _bent(self, k: int, count: int) -> BSpline:
        """Return a place's splines with knots where the first fit bends (de Boor, Good approximation by splines, 1974).

        Equal shares of the integral of the root of curvature, all streams together, lie between them.
        """
        depth = np.sort(self._course.reduced.tip[self._within(k), 2])
        basis, low, high = self._bases[k], float(self._bases[k].t[0]), float(self._bases[k].t[-1])
        at = np.linspace(low, high, 8 * count + 1)
        size = np.maximum(np.abs(self._weights[k]).max(axis=0), 1e-12)
        spline = BSpline(basis.t, self._weights[k] / size, 3)
        bend, rise = spline.derivative(2)(at), np.abs(spline(at) - spline(at[0]))
        # At large readings presses differ by their gains, which resembles bends: half of the bend counts over it.
        each = [np.sqrt(np.sqrt(np.mean(np.square(b), axis=1))) for b in (bend, bend / (LITTLE + rise))]
        monitor = np.mean([m / max(float(m.mean()), 1e-12) for m in each], axis=0)
        inner = len(basis.t) - 7
        share = BENT * monitor + 1 - BENT  # some knots stay evenly spaced: no stretch is without any
        integral = np.concatenate([[0.0], np.cumsum(0.5 * (share[1:] + share[:-1]))])
        knots = np.interp(np.linspace(0, integral[-1], inner), integral, at)
        interior = [low]
        for knot in knots[1:-1]:
            if np.searchsorted(depth, knot) - np.searchsorted(depth, interior[-1]) >= ROWS_EACH:
                interior.append(float(knot))
        ends = np.concatenate([[low] * 3, interior, [high] * 4])
        return BSpline(ends, np.zeros(len(ends) - 4), 3)

    def _within(self, k: int) -> np.ndarray:
        """Return which of the rows read belong to a context, shape (m,), bool."""
        return self.context[self._read] == k

    def _solve(
        self,
        rows: np.ndarray,
        values: np.ndarray,
        design: np.ndarray,
        basis: BSpline,
        smooth: np.ndarray | None = None,
        start: np.ndarray | float = 0.0,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return spline weights, with an offset for every episode fitted as well and left out, and how smooth they are.

        Args:
            rows: Which of the rows read, shape (m,), bool.
            values: Of them, shape (k, streams).
            design: Splines there, shape (k, splines).
            basis: Those splines.
            smooth: Weight of bending, shape (streams,); by restricted maximum likelihood (REML), unless given.
            start: Weights that those returned are added to: together they should bend little.
        """
        reduced, count = self._course.reduced, design.shape[1]
        episode = reduced.episode[rows]
        offsets = (episode[:, None] == np.unique(episode)[None]).astype(float)
        matrix = np.column_stack([design, offsets])
        gram = matrix.T @ matrix
        scale = float(np.mean(np.diag(gram)))
        penalty = np.full(len(gram), RIDGE * scale)
        penalty[count:] = 1e-2 * scale  # offsets are small: the spline takes their common part
        roughness = np.zeros_like(gram)
        roughness[:count, :count] = _roughness(basis)
        # Both matrices are diagonal in these: one factorization for all weights of bending.
        inner = np.linalg.inv(np.linalg.cholesky(gram + np.diag(penalty) + LEAST_SMOOTHING * scale * roughness)).T
        size, turn = np.linalg.eigh(inner.T @ roughness @ inner)
        size, rotation = np.maximum(size, 0.0), inner @ turn
        target = rotation.T @ (matrix.T @ values)
        already = np.zeros((len(gram), values.shape[1]))
        already[:count] = start
        bent = rotation.T @ (roughness @ already)
        if smooth is None:
            smooth = _smoothness(size, target, SLOPES * self._shaken**2)
        weights = rotation @ ((target - smooth * bent) / (1 + size[:, None] * smooth))
        return weights[:count], smooth

    def _both(self, pose: np.ndarray) -> np.ndarray:
        if len(pose) != len(self.context):
            pose = np.broadcast_to(pose, (len(self.context), 3))
        depth = np.array(pose[:, 2])
        for depths, answer in reversed(self._answers):
            if np.array_equal(depths, depth):
                return answer
        result = np.empty((len(pose), self._weights[0].shape[1]))
        for rows, design, air, weights in zip(
            self._rows, self._designs_at(pose), self._air, self._weights, strict=True
        ):
            result[rows] = design @ weights - air @ weights
        result.flags.writeable = False  # others are given the same
        self._answers = [*self._answers[1 - CACHED :], (depth, result)]
        return result

    def _designs_at(self, pose: np.ndarray) -> list[np.ndarray]:
        """Return each place's splines at depths of all rows. The last are kept: most effects move nothing."""
        depth = np.array(pose[:, 2])
        for at, (depths, designs) in enumerate(self._designs):
            if np.array_equal(depths, depth):
                self._designs.append(self._designs.pop(at))
                return designs
        designs = [self._design(basis, depth[rows]) for basis, rows in zip(self._bases, self._rows, strict=True)]
        self._designs = [*self._designs[1 - CACHED :], (depth, designs)]
        return designs

    @staticmethod
    def _basis(depth: np.ndarray, knots: int) -> BSpline:
        low, high = float(depth.min()), float(depth.max())
        high = max(high, low + 1e-6)
        count = int(np.clip(len(depth) // ROWS_EACH, 1, knots))
        inner = np.linspace(low, high, count + 1)
        ends = np.concatenate([[low] * 3, inner, [high] * 3])
        return BSpline(ends, np.zeros(len(ends) - 4), 3)

    @staticmethod
    def _design(basis: BSpline, depth: np.ndarray) -> np.ndarray:
        low, high = basis.t[0], basis.t[-1]
        # Where rows wait in the air, play or delay would leave the outermost spline undecided: flat there.
        start = min(basis.t[4], max(low, 0.0))
        inside = np.clip(depth, start, high)
        design = BSpline.design_matrix(inside, basis.t, 3).toarray()
        # Deeper it goes on straight. Farther away than any row read it stays as it is: in the air nothing presses.
        beyond = np.maximum(depth - high, 0.0)
        if np.any(beyond):
            step = 1e-3 * (high - low)
            near = BSpline.design_matrix(np.full(len(depth), high - step), basis.t, 3).toarray()
            design = design + (design - near) * (beyond / step)[:, None]
        return design


def _roughness(basis: BSpline) -> np.ndarray:
    """Return the quadratic form of weights that is the integral of a spline's squared curvature, shape (k, k).

    Curvature is estimated by divided differences of the weights (general P-splines: Li & Cao, arXiv 2201.06808, 2022).
    Plain ones take the end knots for evenly spaced: they bend a straight line there, to three times its slope. The unit
    is that of plain differences between evenly spaced knots.
    """
    spacing = np.diff((basis.t[1:-3] + basis.t[2:-2] + basis.t[3:-1]) / 3)
    bend = np.zeros((len(spacing) - 1, len(spacing) + 1))
    usual = float(np.median(spacing))
    for k, (first, second) in enumerate(pairwise(spacing)):
        scale = usual**1.5 / np.sqrt(0.5 * (first + second))
        bend[k, k : k + 3] = scale / first, -scale / first - scale / second, scale / second
    return bend.T @ bend


def _smoothness(size: np.ndarray, target: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Return the weight of bending of each stream by restricted maximum likelihood, shape (streams,).

    By the fixed point of Fellner and Schall (Wood & Fasiolo, Biometrics 73, 2017, 1071), the noise known.

    Args:
        size: How much each direction bends, shape (k,).
        target: Inner products of the readings with each direction, shape (k, streams).
        noise: Variance of a reading, shape (streams,).
    """
    bends = (size > 1e-9 * max(float(size.max(initial=0.0)), 1e-300))[:, None]
    smooth = np.ones(target.shape[1])
    for _ in range(REML_STEPS):
        shrinkage = 1 / (1 + size[:, None] * smooth)
        bending = np.sum(size[:, None] * np.square(target * shrinkage), axis=0)
        smooth = np.clip(noise * np.sum(bends * shrinkage, axis=0) / np.maximum(bending, 1e-300), 0.0, MOST_SMOOTHING)
    return smooth


def _shaken(trace: np.ndarray, course: Course) -> np.ndarray:
    """Return the noise of means of rows times the root of their number [each stream's unit], shape (streams,).

    Estimated by second differences of successive means of a response's residual; 0 where there are none.
    """
    steps = np.zeros((0, trace.shape[1]))
    for rows in np.split(np.arange(len(trace)), np.flatnonzero(np.diff(course.episode)) + 1):
        blocks = len(rows) // BLOCK
        if blocks >= 3:
            means = trace[rows[: blocks * BLOCK]].reshape(blocks, BLOCK, -1).mean(axis=1)
            steps = np.concatenate([steps, means[2:] - 2 * means[1:-1] + means[:-2]])
    # A second difference has 6 times the variance of a mean of BLOCK rows.
    return 1.4826 * np.median(np.abs(steps), axis=0) * np.sqrt(BLOCK / 6) if len(steps) else np.zeros(trace.shape[1])


def about_means(residual: np.ndarray, course: Course) -> np.ndarray:
    """Return sums of squares about each episode's mean, shape (episodes, streams); missing readings count as 0.

    Args:
        residual: Of the rows read, shape (m, streams); NaN where nothing was read.
        course: Whose rows.
    """
    finite, episode = np.nan_to_num(residual), course.reduced.episode
    into = csr_array((np.ones(len(episode)), (episode, np.arange(len(episode)))), shape=(course.episodes, len(episode)))
    mean = (into @ finite) / np.maximum(into.sum(axis=1), 1)[:, None]
    return into @ np.square(finite - mean[episode])
