"""The grounds of a column's role: its name, its unit, its course over time."""

import re

import numpy as np

from tacdata.importing.proposing.roles import GUESSES, bare_name
from tacdata.importing.proposing.source_kind import SourceKind
from tacdata.importing.units import plain, quantity_of, split_unit

SAID = {"by_values": "it rises evenly", "by_shape": "its shape: smooth, comes back, the readings follow it"}
"""Mark that the search for roles leaves -> words."""
FOLLOWS = 0.5
"""Smallest correlation with the position that is named [1]."""


def evidence(kind: SourceKind, name: str, path: np.ndarray | None, idle: dict[str, str]) -> tuple[str, ...]:
    """Return what speaks for a column's role, or against one.

    Args:
        kind: The file and the roles that were found.
        name: The column.
        path: The position in each row of this file [any], shape (rows,); None if it is in another one.
        idle: Columns that measure nothing, and the reasons (`without_signal`).
    """
    table, grounds = kind.table, list[str]()
    outer = name.rpartition("[")[0] if name not in table.columns else name
    roles = [role for role, names in kind.roles.items() if name in names or outer in names]
    bare = bare_name(name)
    grounds += [f"its name states {role}" for role in roles if role in GUESSES and re.fullmatch(GUESSES[role], bare)][
        :1
    ]
    unit = plain(table.units.get(outer) or split_unit(outer)[1])
    if quantity_of(unit) in ("mm", "N", "s", "deg"):
        grounds.append(f"its unit is {unit}")
    grounds += [words for mark, words in SAID.items() if name in kind.roles.get(mark, [])]
    values = table.column(name)
    if values.dtype == object:
        texts = list(dict.fromkeys(str(value) for value in values.tolist() if value is not None))
        grounds += ["it reads as dates or times of day"] if "time" in roles else []
        return (*grounds, f"text, {len(texts)} different: {', '.join(texts[:3])}")
    if name in idle:
        grounds.append({"constant": "it never changes"}.get(idle[name], f"it is {idle[name]}"))
    return (*grounds, *_course(values.astype(float), path))


def _course(values: np.ndarray, path: np.ndarray | None) -> list[str]:
    """Return the range of a column, and how it follows the position."""
    finite = np.isfinite(values)
    if not finite.any():
        return ["no value"]
    low, high = float(values[finite].min()) + 0.0, float(values[finite].max()) + 0.0
    words = [f"{low:.6g} to {high:.6g}"]
    if not finite.all():
        words.append(f"{100 * (1 - finite.mean()):.2g} % missing")
    steps = np.diff(values[finite])
    if len(steps) > 2 and (steps > 0).all():
        words.append("always rises")
    elif path is not None and high > low and path is not values:
        joint = finite & np.isfinite(path)
        if joint.sum() > 2 and np.ptp(path[joint]) > 0 and np.ptp(values[joint]) > 0:
            correlation = float(np.corrcoef(path[joint], values[joint])[0, 1])
            if FOLLOWS <= abs(correlation) < 0.9999999:
                words.append(f"follows the position (r = {correlation:.2f})")
    return words
