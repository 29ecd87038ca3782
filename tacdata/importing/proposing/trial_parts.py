"""Parts of one trial in several files or sheets, as of a ramp and a hold."""

import re
from dataclasses import dataclass
from itertools import pairwise, permutations

import numpy as np

from tacdata.importing.proposing.roles import roles_of
from tacdata.importing.source_table import SourceTable

NEAR, DEEP = 0.05, 0.5
"""Largest distance between the end of a part and the beginning of the next, and smallest distance between the ends of a
part that is no whole press [range of the position]."""
ORDER = tuple(
    re.compile(rf"(?<![a-z])({words})(?![a-z])", re.IGNORECASE)
    for words in (
        "ramp|load(ing)?|approach|press|push|in|up|begin|rampe",
        "hold|dwell|relax(ation)?|creep|steady|halten",
        "unload(ing)?|release|retract|return|out|down|end|recovery",
    )
)
"""Words of parts of a trial, in the order of time."""
NEXT = 1.5
"""Largest step from the end of a part of a log to the next part [usual steps]."""
MOST = 4
"""Most parts of a trial [count]."""


@dataclass(frozen=True)
class PartsInOrder:
    """Parts of a trial."""

    keys: tuple[str, ...]
    """Kinds of files or sheets, in their order."""
    join: str
    """``rows`` if one clock runs through, ``continued`` if each part's clock begins again, ``columns`` side by side."""


def parts_in_order(tables: dict[str, SourceTable]) -> PartsInOrder | None:
    """Return the order in which each table begins where the one before it ends, deep in the skin; None without one.

    Whole presses end where they began, so they are no parts.
    """
    if not 2 <= len(tables) <= MOST:
        return None
    roles = {key: roles_of(table) for key, table in tables.items()}
    moving = [name for each in roles.values() for name in (each.get("depth") or each.get("z") or [])[:1]]
    clocks = [name for each in roles.values() for name in each.get("time", [])[:1]]
    first = next(iter(tables.values()))
    if not moving or not clocks or not {moving[0], clocks[0]} <= set(first.columns):
        return None
    paths = {key: _numbers(table, moving[0]) for key, table in tables.items()}
    times = {key: _numbers(table, clocks[0]) for key, table in tables.items()}
    if any(len(values) < 2 for values in (*paths.values(), *times.values())):
        return None
    span = float(np.ptp(np.concatenate(list(paths.values()))))
    fitting = []
    for keys in permutations(tables):
        seams = list(pairwise(keys))
        near = all(abs(paths[b][0] - paths[a][-1]) <= NEAR * span for a, b in seams)
        if span > 0 and near and abs(paths[keys[0]][-1] - paths[keys[0]][0]) >= DEEP * span:
            fitting.append(keys)
    if not fitting:
        return None
    # A ramp up and a ramp down fit in both orders: names decide, then a path that begins at its zero.
    keys = min(fitting, key=lambda keys: (_disorder(keys), abs(paths[keys[0]][0])))
    through = all(times[b][0] >= times[a][-1] for a, b in pairwise(keys))
    return PartsInOrder(keys, "rows" if through else "continued")


def is_split_log(tables: list[SourceTable]) -> bool:
    """Return whether the clock of each table goes on by one step where that of the table before it ends."""
    names = [roles_of(table).get("time", [""])[0] for table in tables]
    clocks = [_numbers(table, name) for table, name in zip(tables, names, strict=True)]
    if len(tables) < 2 or not names[0] or len(set(names)) > 1 or any(len(clock) < 3 for clock in clocks):
        return False
    usual = float(np.median(np.diff(clocks[0])))
    return usual > 0 and all(0 < later[0] - clock[-1] <= NEXT * usual for clock, later in pairwise(clocks))


def _disorder(keys: tuple[str, ...]) -> int:
    """Return how many parts stand before one that comes before them by its name."""
    ranks = [next((rank for rank, words in enumerate(ORDER) if words.search(key)), None) for key in keys]
    positions = [rank for rank in ranks if rank is not None]
    return sum(a > b for a, b in pairwise(positions))


def _numbers(table: SourceTable, name: str) -> np.ndarray:
    """Return the finite numbers of a column, shape (n,); none of a column of text."""
    values = table.columns.get(name, np.empty(0, object))
    if values.dtype == object or values.ndim > 1:
        return np.empty(0)
    return values[np.isfinite(values.astype(float))].astype(float)
