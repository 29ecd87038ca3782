"""How a machine differs from a healthy one: mechanisms with their sizes, the unnamed remainder, and a control."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from tacdata.chain import Course
from tacdata.errors import FormatError
from tacdata.reference.conditions import FEWEST, Matched, PressKind, matched
from tacdata.reference.evidence import EXCLUSIVE, OFFSET, Posterior, blocks, changing, posterior
from tacdata.reference.shapes import LAGGING, Shape, shapes

NAMED = 0.95
"""Probability from which a mechanism is named [1]."""
LEVEL = 0.01
"""Probability that any of a machine's sizes is called a change while there is none [1]."""
LEAST = 0.02
"""A change of the readings below this share of their range counts as none [1]."""
REPEATED = 2.0
"""A change counts from so many times that of the control [1]."""
EXPLAINED = 0.5
"""A name explains at least this share of the difference where it is [1]."""
FAINT = 1e-3
"""A combination of shapes that is smaller, over the largest, is not sized [1]."""
VISIBLE = 0.3
"""A shape is sized at steady speed alone if so much of it is there [1]."""
NEEDED = 0.15
"""A second name explains at least this share of the difference by itself: less may be form error of the first [1]."""
WINDOWS = 20
"""Parts of a press whose means are compared, whatever the name."""
LAGS = (0.003, 0.006, 0.012, 0.025, 0.05)
"""Lengths of a delay or a filter that are tried first, over the shortest press [1]..."""
NEARER = (0.59, 0.71, 0.84, 1.0, 1.19, 1.41, 1.68)
"""...and then, over the best of them: a curve near another length fits worse than another mechanism's [1]."""
CLEAR = 0.9
"""A zero that is off explains at least this share by itself: it fits any remainder in part [1]."""
Z90 = 1.645
"""Standard errors either way of a 90 % interval."""


@dataclass(frozen=True)
class Size:
    """Size of one mechanism in one condition and channel."""

    condition: str
    channel: int
    value: float
    """[the shape's unit]"""
    error: float
    """Standard error, with all that wanders within a session [the shape's unit]."""
    peak: float
    """Largest change of the readings by it [the source's unit], signed."""
    peak_error: float
    """Standard error of that [the source's unit]."""
    share: float
    """Peak over the mean healthy reading where it acts, without sign; of a response over its range [1]."""
    p: float
    """p-value of "no change" [1]."""
    changed: bool = False
    """Whether it is beyond scatter, the control and `LEAST`."""

    @property
    def bound(self) -> float:
        """Size of the change of readings that is excluded at 95 % [the source's unit]."""
        return abs(self.peak) + Z90 * self.peak_error


@dataclass(frozen=True)
class Mechanism:
    """One mechanism of the answer."""

    name: str
    form: str
    unit: str
    """Unit of its sizes; "reading" is the readings' unit."""
    probability: float
    sizes: tuple[Size, ...]
    rival: str = ""
    """Another mechanism that these presses do not exclude; empty for none."""

    @property
    def changed(self) -> tuple[Size, ...]:
        """Sizes that are a change."""
        return tuple(s for s in self.sizes if s.changed)


@dataclass(frozen=True)
class Control:
    """The healthy machine compared with itself."""

    split: str
    """How its presses were split."""
    quiet: bool
    largest: float
    """Largest change of the readings by any mechanism of the answer [the source's unit]."""


@dataclass(frozen=True)
class Difference:
    """How a machine differs from a healthy one."""

    status: str
    """none, named, "named, incomplete", or unknown."""
    mechanisms: tuple[Mechanism, ...]
    """Those of the most probable set, named or not."""
    probabilities: dict[str, float]
    """Of each mechanism, that it is there [1]."""
    explained: float
    """Share of the difference that the mechanisms explain where they are a change [1]."""
    differs: bool
    """Whether the readings differ beyond the healthy machine's scatter, whatever the name."""
    largest: float
    """Largest difference of the readings [the source's unit]."""
    where: str
    """PressKind of it."""
    controls: tuple[Control, ...]
    conditions: tuple[PressKind, ...]
    columns: tuple[tuple[Shape, ...], ...]
    """Chosen shapes of each condition."""
    unmatched: int
    channels: tuple[str, ...]

    @property
    def named(self) -> tuple[Mechanism, ...]:
        """The mechanisms that are named."""
        if self.status not in ("named", "named, incomplete"):
            return ()
        return tuple(m for m in self.mechanisms if m.probability >= NAMED and m.changed)


ZERO = "zero"
"""Mechanism of readings that are off by the same at every point of a press, without an effect of its own."""


def difference(course: Course, names: Sequence[str], measured: np.ndarray) -> Difference:
    """Compare a machine with a healthy one.

    Args:
        course: Both machines' recordings, read together.
        names: Specimen of each episode as the source names it; empty where it names none.
        measured: Whether an episode is of the other machine, shape (episodes,), bool.

    Raises:
        FormatError: If too few presses are of the same kind in both.
    """
    pairs = matched(course, names, measured)
    if not pairs.conditions:
        raise FormatError(
            f"no press of the same place, depth and pace {FEWEST} times in both sessions",
            f"{FEWEST} or more presses of one kind, healthy and not: their scatter is the noise",
            "record the same plan on both, each press several times",
        )
    lags, columns, belief = _model(pairs.conditions)
    selection = _chosen(columns[0], belief)
    controls, bounds = [], {}
    for split, first in (("first half and second half", _first), ("odd and even presses", _odd)):
        if min(len(c.healthy) for c in pairs.conditions) < 2 * FEWEST:
            continue
        halves = tuple(c.split(first(len(c.healthy))) for c in pairs.conditions)
        sizes = _mechanisms(halves, [shapes(c, lags) for c in halves], belief, selection, {})
        peaks = {(m.name, s.condition, s.channel): abs(s.peak) for m in sizes for s in m.sizes}
        bounds = {key: max(bounds.get(key, 0.0), peaks.get(key, 0.0)) for key in {*bounds, *peaks}}
        quiet = _compared(replace(pairs, conditions=halves), *_model(halves)[1:]).status == "none"
        controls.append(Control(split, quiet, max(peaks.values(), default=0.0)))
    # A change within the healthy machine is no change of the other one.
    answer = _compared(pairs, columns, belief, bounds)
    if answer.named and not all(c.quiet for c in controls):
        answer = replace(answer, status="unknown")
    return replace(answer, controls=tuple(controls))


def _first(count: int) -> np.ndarray:
    return np.arange(count) < count // 2


def _odd(count: int) -> np.ndarray:
    return np.arange(count) % 2 == 0


def _chosen(columns: list[Shape], belief: Posterior) -> tuple[int, ...]:
    """Return the shapes that are sized: the best form of each probable mechanism, or else the most probable set."""
    probable = {m for m, p in belief.mechanisms.items() if p >= NAMED}
    for pair in EXCLUSIVE:
        if not pair & probable and sum(belief.mechanisms.get(m, 0.0) for m in pair) >= NAMED:
            probable.add(max(pair, key=lambda m: belief.mechanisms.get(m, 0.0)))
    forms = [
        max((k for k, s in enumerate(columns) if s.mechanism == m), key=lambda k: belief.of_shape[k]) for m in probable
    ]
    return tuple(sorted(forms)) or belief.best


def _with_rival(mechanism: str, belief: Posterior) -> tuple[float, str]:
    """Return a mechanism's probability, and the rival that shares it; alone where it needs none."""
    probability = belief.mechanisms[mechanism]
    pair = next((p for p in EXCLUSIVE if mechanism in p), frozenset({mechanism}))
    joint = sum(belief.mechanisms.get(m, 0.0) for m in pair)
    if probability >= NAMED or joint < NAMED:
        return probability, ""
    return joint, next(iter(pair - {mechanism}))


def _model(conditions: tuple[PressKind, ...]) -> tuple[dict[str, np.ndarray], list[list[Shape]], Posterior]:
    """Return lengths of lags [s], the shapes of each condition with these, and their probabilities."""
    delays = min(float(np.ptp(c.time)) for c in conditions) * np.array(LAGS)
    # A longer filter has the curve of a relaxation.
    lags = {"low_pass_filter": delays[:-1], "latency": delays}
    columns = [shapes(c, lags) for c in conditions]
    support = posterior(conditions, columns).support
    for name in LAGGING:
        best = np.argmax([p for p, s in zip(support, columns[0], strict=True) if s.mechanism == name])
        lags[name] = lags[name][best] * np.array(NEARER)
    columns = [shapes(c, lags) for c in conditions]
    return lags, columns, posterior(conditions, columns)


def _compared(
    pairs: Matched,
    columns: list[list[Shape]],
    belief: Posterior,
    control: dict[tuple[str, str, int], float] | None = None,
) -> Difference:
    conditions = pairs.conditions
    selection = _chosen(columns[0], belief)
    mechanisms = _mechanisms(conditions, columns, belief, selection, control or {})
    changed = tuple(k for k, m in zip(selection, mechanisms, strict=False) if m.changed)
    needed = _needed(conditions, columns, changed, mechanisms)
    if needed and needed != selection:  # sizes are fitted without the shapes that are too small to count
        selection = needed
        mechanisms = _mechanisms(conditions, columns, belief, selection, control or {})
    explained = _explained(conditions, columns, selection, mechanisms)
    differs, largest, where = _beyond_scatter(conditions)
    named = [m for m in mechanisms if m.probability >= NAMED and m.changed]
    if not differs and not any(m.changed for m in mechanisms):
        status = "none"
    elif not named or explained < (CLEAR if {m.name for m in named} == {ZERO} else EXPLAINED):
        status = "unknown"
    else:
        status = "named" if explained >= CLEAR else "named, incomplete"
    return Difference(
        status,
        mechanisms,
        belief.mechanisms,
        explained,
        differs,
        largest,
        where,
        (),
        conditions,
        tuple(tuple(s[k] for k in selection) for s in columns),
        pairs.unmatched,
        pairs.channels,
    )


def _solved(condition: PressKind, columns: list[Shape], of: tuple[int, ...], channel: int) -> tuple[np.ndarray, ...]:
    """Return sizes of the chosen shapes and the offset: of the difference, and of each block, healthy and other.

    Least squares where the speed is steady: where it changes, each machine overshoots in a way of its own.
    """
    scales = np.array([*(columns[k].typical[channel] for k in of), OFFSET * condition.range[channel]])
    ones = np.ones(len(condition.time))
    matrix = np.column_stack([*(columns[k].curves[:, channel] for k in of), ones]) * scales
    steady = ~changing(condition)
    # A delay shows where the speed changes and nowhere else.
    energy = np.square(matrix - matrix.mean(axis=0)).sum(axis=0)[:-1]
    steady_energy = np.square(matrix[steady] - matrix[steady].mean(axis=0)).sum(axis=0)[:-1]
    visible = bool((steady_energy >= VISIBLE * energy).all())
    is_determined = np.linalg.matrix_rank(matrix[steady], tol=FAINT * np.abs(matrix).max()) == matrix.shape[1]
    rows = steady if is_determined and visible else np.ones(len(matrix), dtype=bool)
    gram = matrix[rows].T @ matrix[rows]
    # A little ridge, since shapes may be nearly collinear in one condition.
    solver = scales[:, None] * np.linalg.solve(gram + FAINT**2 * np.trace(gram) * np.eye(len(gram)), matrix[rows].T)
    sides = [(blocks(side) - condition.base)[:, rows, channel].T for side in (condition.healthy, condition.measured)]
    return tuple(solver @ values for values in (condition.difference[rows][:, [channel]], *sides))


def _mechanisms(
    conditions: tuple[PressKind, ...],
    columns: list[list[Shape]],
    belief: Posterior,
    selection: tuple[int, ...],
    control: dict[tuple[str, str, int], float],
) -> tuple[Mechanism, ...]:
    sizes: list[list[Size]] = [[] for _ in range(len(selection) + 1)]
    for condition, shapes_of in zip(conditions, columns, strict=True):
        for channel in range(condition.base.shape[1]):
            value, healthy, measured = _solved(condition, shapes_of, selection, channel)
            freedom = healthy.shape[1] + measured.shape[1] - 2
            # A session is one draw of the effect that varies from block to block: averaging does not make it smaller.
            spread = np.square(healthy - healthy.mean(axis=1, keepdims=True)).sum(axis=1)
            spread += np.square(measured - measured.mean(axis=1, keepdims=True)).sum(axis=1)
            error = np.sqrt(2 * spread / freedom)
            for j in range(len(selection) + 1):
                zero = j == len(selection)
                curve = np.ones(len(condition.time)) if zero else shapes_of[selection[j]].curves[:, channel]
                if not curve.any():
                    continue
                at = int(np.argmax(np.abs(curve)))
                acting = np.abs(curve) > 0.5 * np.abs(curve[at])
                usual = float(np.abs(condition.base[acting, channel]).mean())
                # A response, as of a capacitance, counts from its rest; an effort, as a current, from zero.
                usual = usual if condition.effort else float(condition.range[channel])
                top, size = abs(float(curve[at])), float(value[j, 0])
                spread, peak = float(error[j]), top * size
                p = 2 * float(stats.t.sf(abs(size / max(spread, 1e-300)), freedom))
                share = peak / max(usual, 1e-300)
                sizes[j].append(Size(condition.name, channel, size, spread, peak, top * spread, share, p))
    ranges = {c.name: c.range for c in conditions}
    # Bonferroni, over all sizes that could have been a change.
    tests = max(len({s.mechanism for s in columns[0]}) * len(conditions) * conditions[0].base.shape[1], 1)
    probable = [(columns[0][k], *_with_rival(columns[0][k].mechanism, belief)) for k in selection]
    answer = []
    for j, name in enumerate([*(shape.mechanism for shape, _, _ in probable), ZERO]):
        judged = tuple(
            replace(
                s,
                changed=s.p * tests < LEVEL
                and abs(s.peak) > LEAST * ranges[s.condition][s.channel]
                and abs(s.peak) > REPEATED * control.get((name, s.condition, s.channel), 0.0),
            )
            for s in sizes[j]
        )
        if name != ZERO:
            shape, probability, rival = probable[j]
            answer.append(Mechanism(name, shape.form, shape.unit, probability, judged, rival))
        elif any(s.changed for s in judged):
            answer.append(Mechanism(ZERO, "of the readings", "reading", 1.0, judged))
    return tuple(answer)


def _needed(
    conditions: tuple[PressKind, ...],
    columns: list[list[Shape]],
    selection: tuple[int, ...],
    mechanisms: tuple[Mechanism, ...],
) -> tuple[int, ...]:
    """Return the shapes without which clearly less of the difference would be explained; a lone one is needed."""
    if len(selection) < 2:
        return selection
    total = _explained(conditions, columns, selection, mechanisms)
    losses = {}
    for k in selection:
        remainder = tuple(j for j in selection if j != k)
        losses[k] = total - _explained(conditions, columns, remainder, mechanisms)
    return tuple(k for k in selection if losses[k] >= NEEDED) or (max(selection, key=lambda k: losses[k]),)


def _explained(
    conditions: tuple[PressKind, ...],
    columns: list[list[Shape]],
    selection: tuple[int, ...],
    mechanisms: tuple[Mechanism, ...],
) -> float:
    """Return the share of the difference, offsets apart, that the mechanisms explain where they are a change."""
    places = {(s.condition, s.channel) for m in mechanisms for s in m.changed}
    zeros = {(s.condition, s.channel) for m in mechanisms if m.name == ZERO for s in m.changed}
    initial = final = 0.0
    for condition, shapes_of in zip(conditions, columns, strict=True):
        for channel in range(condition.base.shape[1]):
            if (condition.name, channel) not in places:
                continue
            value, *_ = _solved(condition, shapes_of, selection, channel)
            curves = [shapes_of[k].curves[:, channel] for k in selection]
            fitted = value[-1, 0] + (np.array(curves).T @ value[:-1, 0] if curves else 0.0)
            residual = condition.difference[:, channel] - fitted
            level = condition.difference[:, channel] - (0.0 if (condition.name, channel) in zeros else value[-1, 0])
            scale = condition.range[channel] ** 2
            initial += float(np.sum(np.square(level))) / scale
            final += float(np.sum(np.square(residual))) / scale
    return 1 - final / initial if initial > 0 else 0.0


def _beyond_scatter(conditions: tuple[PressKind, ...]) -> tuple[bool, float, str]:
    """Return whether the sessions differ beyond the scatter of blocks, and the largest difference with its place."""
    largest, where, beyond = 0.0, "", []
    for c in conditions:
        sides = [_windows(blocks(side)) for side in (c.healthy, c.measured)]
        shift = sides[1].mean(axis=0) - sides[0].mean(axis=0)
        freedom = sum(len(s) for s in sides) - 2
        spread = sum(np.square(s - s.mean(axis=0)).sum(axis=0) for s in sides) / freedom
        t = np.abs(shift) / np.sqrt(np.maximum(2 * spread, 1e-300))
        tests = len(conditions) * shift.size
        beyond.append(bool(((2 * stats.t.sf(t, freedom) * tests < LEVEL) & (np.abs(shift) > LEAST * c.range)).any()))
        at = float(np.abs(shift).max())
        if at > largest:
            largest, where = at, c.name
    return any(beyond), largest, where


def _windows(values: np.ndarray) -> np.ndarray:
    """Return means over successive parts of a press, shape (blocks, windows, channels): points are noisy."""
    return np.stack([part.mean(axis=1) for part in np.array_split(values, WINDOWS, axis=1)], axis=1)
