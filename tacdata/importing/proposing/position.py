"""The position of a press and its consequences: sign, contact, and the end of a trial."""

import re
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from tacdata.chain.at_rest import below_zero, zero_side
from tacdata.errors import FormatError
from tacdata.importing.mapping import Axis, PositionEntry, Quantity, SourceClock, TrialRule, Value
from tacdata.importing.proposing.drives import length_of
from tacdata.importing.proposing.file_kinds import listed
from tacdata.importing.proposing.question import Question
from tacdata.importing.proposing.source_kind import SourceKind
from tacdata.importing.proposing.strokes import CLEAR, PressingAxis, pressing_axis
from tacdata.importing.source_table import SourceTable, unit_of
from tacdata.importing.times import times
from tacdata.importing.units import factor, quantity_of, split_unit

ENDS, FAR = 3, 5.0
"""Most first rows that are no positions [rows], and their smallest distance from all others [their range]."""
COUNTED = re.compile(r"(?<![a-z])(micro)?(steps?|ticks?|pulses|counts|increments)(?![a-z])", re.IGNORECASE)
"""Words of a position that a motor or an encoder counts."""
PRESSED = 0.5
"""Smallest share of the largest depth that is a press [1]; between two presses a path comes below half of it."""
SHORTEST = 0.02
"""Strokes below are hardly in mm [mm]."""


@dataclass(frozen=True)
class ProposedPosition:
    """A position, and what follows from its path."""

    entry: PositionEntry | None = None
    contact: dict[str, Value] = field(default_factory=dict)
    """Height at which the skin is touched."""
    known_from: str = "as the mapping says"
    trials: TrialRule = field(default_factory=TrialRule)
    questions: tuple[Question, ...] = ()


def proposed_position(
    kind: SourceKind, clock: SourceClock, channels: list[str], *, pauses: bool = True
) -> ProposedPosition:
    """Return the position in a kind of file that has a depth or a height.

    Args:
        kind: The kind.
        clock: Its clock.
        channels: The sensor's channels, which follow the position where they are in the same file.
        pauses: Whether a pause of the clock may end a trial.
    """
    table, roles = kind.table, kind.roles
    pressing = "depth" if "depth" in roles else "z"
    names = {key: roles[key][0] for key in ("x", "y", pressing) if key in roles}
    questions: list[Question] = []
    if "by_shape" in roles:
        words = "taken for the position by its shape: it is smooth, comes back, and the readings follow it"
        questions.append(Question(f"{names['depth']}: {words}"))
    unsaid = [name for name in names.values() if name not in table.units and quantity_of(split_unit(name)[1]) != "mm"]
    unit, path = "mm", table.column(names[pressing])
    # A stroke below 0.02 is no press in mm, but 2 mm written in m is.
    if unsaid and "stand_in" not in roles and float(np.nanmax(path) - np.nanmin(path)) < SHORTEST:
        unit = "m"
    counted = [name for name in unsaid if COUNTED.search(name)]
    units = dict.fromkeys(unsaid, unit) | dict.fromkeys(counted, "steps")
    axes = {key: Axis(name, units.get(name, "")) for key, name in names.items()}
    if "error" in roles and roles.get("depth") == roles.get("set_point", [None])[:1]:
        axes["depth"], question = _without_error(table, names["depth"], roles["error"][0])
        questions.append(question)
    if "stand_in" in roles:
        axes["depth"] = replace(axes["depth"], unit=length_of(table, roles["stand_in"][0]))
    elif counted:
        words = "it counts steps: how many are a millimetre? Give unit: mm and scale: 1 / that number"
        questions.append(Question(f"{listed(counted)}: {words}", "unit", tuple(counted)))
    elif unsaid:
        questions.append(Question(f"{listed(unsaid)}: no unit is given; {unit} is a guess", "unit", tuple(unsaid)))
    for name, unit in {name: table.units.get(name, "") for name in names.values()}.items():
        if unit and quantity_of(unit) != "mm" and "stand_in" not in roles:
            words = f"how many mm are 1 {unit}? Give unit: mm, and their number as scale"
            questions.append(Question(f"{name}: it is in {unit}: {words}", "unit", (name,)))
    entry = PositionEntry(file=kind.alias, clock=clock, axes=dict[str, Quantity](axes))
    try:
        time_ns, _ = times(table, clock, "")
    except FormatError:  # reported where the clock was read; the path has a sign and a zero at any rate
        time_ns, pauses = np.arange(table.rows) * 10_000_000, False
    try:
        path = _without_ends(table.column(names[pressing]).astype(float))
        motion = pressing_axis(time_ns, path, _deviation(table, channels, path), pauses=pauses)
    except ValueError:
        return ProposedPosition(entry, questions=tuple(questions))
    return _turned(entry, kind, axes, motion, channels, questions)


def _turned(
    entry: PositionEntry,
    kind: SourceKind,
    axes: dict[str, Axis],
    motion: PressingAxis,
    channels: list[str],
    questions: list[Question],
) -> ProposedPosition:
    """Return the position with its sign, as a depth or a machine's height, with trials cut by pauses or presses."""
    proposed, pressing = ProposedPosition(), next(reversed(axes))
    axis, others, name = axes[pressing], {key: axes[key] for key in axes if key != pressing}, kind.roles[pressing][0]
    if pressing == "depth" and motion.lifted:
        pressing = "z"
    elif pressing == "z" and motion.sign > 0 and motion.at_zero and not others:
        pressing = "depth"
    is_depth = pressing == "depth"
    if motion.sign * (1 if is_depth else -1) < 0:
        axis = replace(axis, scale=-1.0)
        way = "falls" if motion.sign < 0 else "grows"
        text = f"{name}: it {way} into the skin, so its sign is turned (scale: -1)"
        questions.append(Question(text, "sign", (name,)))
    offset, change = _lowest(axis, kind.table, name, channels)
    if change:
        text = (
            f"{name}: from row {change} on presses go to the other side of zero: was its direction changed? Then make "
            "two files of it, and give scale: -1 for one"
        )
        questions.append(Question(text, "sign", (name,)))
    if is_depth and offset:
        axis = replace(axis, offset=offset)
        text = (
            f"{name}: readings answer on both sides of its zero, so depth is counted from the lowest "
            f"(offset: {offset:g} mm); do other files go lower? Then take the lowest of all"
        )
        questions.append(Question(text, "zero", value=offset))
    if not is_depth and motion.at_zero:
        proposed = replace(proposed, contact={"z": 0.0}, known_from="the zero of the machine")
        text = f"{name}: its zero is taken for the height at which the skin is touched (contact: {{z: 0}})"
        questions.append(Question(text, "contact"))
    elif not is_depth and "stand_in" in kind.roles:
        text = f"{name}: it does not rest at zero; depth is counted from where each trial is at rest"
        questions.append(Question(text, "contact"))
    elif not is_depth:
        text = (
            f"{name}: a machine's height; where does it touch the skin? Give contact: {{z: ...}}, else depth is "
            "counted from the highest position of each trial"
        )
        questions.append(Question(text, "contact"))
    if "trial" not in kind.roles and motion.pause:
        proposed = replace(proposed, trials=TrialRule(gap=motion.pause))
        pause = f"{motion.pauses} pause{'s' * (motion.pauses > 1)} of more than {motion.pause:g} s"
        questions.append(Question(f"{pause}: each is taken for the end of a trial", "trials"))
    elif "trial" not in kind.roles and motion.strokes > 1 and (is_depth or not motion.at_zero or kind.found.count == 1):
        above = f"{motion.above * _in_mm(kind.table, name, axis):.2g}"
        proposed = replace(proposed, trials=TrialRule(press_above=float(above)))
        stretches = f"each stretch deeper than {above} mm is taken for a trial"
        questions.append(Question(f"{motion.strokes} presses without a pause: {stretches}", "trials"))
    return replace(proposed, entry=replace(entry, axes=others | {pressing: axis}), questions=tuple(questions))


def _lowest(axis: Axis, table: SourceTable, name: str, channels: list[str]) -> tuple[float, int]:
    """Return what is added to a depth [mm] so that it counts from its lowest, where readings answer below zero.

    Returns:
        The sum, and the row where readings begin to answer to the other sign alone; 0 without one.
    """
    parts = [table.column(channel) for channel in channels if channel in table.columns]
    if not parts:
        return 0.0, 0
    depth = axis.scale * table.column(name).astype(float) * _in_mm(table, name, axis)
    readings = np.column_stack(parts).astype(float)
    whole = zero_side(depth, readings)
    if whole.answered(whole.whole)[0] and (change := _change_of_side(depth)):
        return 0.0, change
    low = below_zero([zero_side(depth[rows], readings[rows]) for rows in _each_press(depth)])
    return float(np.ceil(1000 * low) / 1000), 0


def _change_of_side(depth: np.ndarray) -> int:
    """Return the row from which all presses go to the other side of zero than those before; 0 without one.

    A piston goes to both sides in turn, and a stage is in the air between two presses.
    """
    share = np.nan_to_num(depth) / np.nanmax(np.abs(depth))
    known = np.flatnonzero((np.abs(share) > PRESSED) | (np.abs(share) < 0.5 * PRESSED))
    side = np.sign(share[known]) * (np.abs(share[known]) > PRESSED)
    begins = np.flatnonzero(np.diff(side, prepend=0.0) * side > 0)
    changes = np.flatnonzero(np.diff(side[begins])) + 1
    return int(known[begins[changes[0]]]) if len(changes) == 1 and len(begins) > 2 else 0


def _each_press(depth: np.ndarray) -> list[slice]:
    """Return the rows from each highest point of a path to the next, one press each."""
    filled = np.nan_to_num(depth, nan=np.nanmin(depth))
    deep = filled > filled.min() + 0.5 * np.ptp(filled)
    edges = np.flatnonzero(np.diff(deep.astype(np.int8)))
    begins, ends = edges[~deep[edges]], edges[deep[edges]]
    successors = [int(begins[begins > end][0]) for end in ends if (begins > end).any()]
    middles = [(int(end) + begin) // 2 for end, begin in zip(ends, successors, strict=False)]
    return [slice(a, b) for a, b in pairwise([0, *middles, len(depth)])]


def _in_mm(table: SourceTable, name: str, axis: Axis) -> float:
    """Return the factor of a column's unit, 1 where it has no length: the trial run of the mapping reports that."""
    try:
        return factor(unit_of(table, name if axis.expression else axis.column, name, axis.unit) or "mm", "mm", "")
    except FormatError:
        return 1.0


def _without_ends(path: np.ndarray) -> np.ndarray:
    """Return a path [as in the file] without first rows that lie far from all others, as of a logger that begins at 0.

    Shape (rows,), NaN there.
    """
    for rows in range(1, ENDS + 1):
        others = path[rows:]
        if len(others) > ENDS and abs(others[0] - path[rows - 1]) > FAR * np.ptp(others[np.isfinite(others)]) > 0:
            return np.concatenate([np.full(rows, np.nan), others])
    return path


def _deviation(table: SourceTable, channels: list[str], axis: np.ndarray) -> np.ndarray | None:
    """Return how far the readings are from their first rows, each by its own range, shape (rows,); None if unknown.

    First rows end where the axis moves: cycles may begin at once.
    """
    parts = [table.column(name) for name in channels if name in table.columns]
    if not parts:
        return None
    values = np.column_stack(parts).astype(float)
    spread = np.nanmax(values, axis=0) - np.nanmin(values, axis=0)
    rows = np.flatnonzero(np.isfinite(axis))
    way = np.abs(axis - axis[rows[:1]].sum())
    departures = np.flatnonzero(way > CLEAR * np.ptp(axis[rows])) if len(rows) else rows
    first = np.nanmedian(values[: max(min([len(values) // 50, *departures[:1].tolist()]), 1)], axis=0)
    deviation = np.abs(values - first) / np.where(spread > 0, spread, 1.0)
    rows = np.isfinite(deviation)
    return np.where(rows, deviation, 0.0).sum(axis=1) / np.where(rows.any(axis=1), rows.sum(axis=1), np.nan)


def _without_error(table: SourceTable, target: str, error: str) -> tuple[Axis, Question]:
    """Return the measured depth as the set point minus the position error, and the question that this raises."""
    stated = table.units.get(target)
    axis = Axis(unit="" if stated and stated == table.units.get(error) else "mm", expression=f"`{target}` - `{error}`")
    text = f"the position is taken as {target} - {error}: is the error the set point minus the position?"
    return axis, Question(text)
