"""Success rates of trials with Wilson's intervals, by condition and group of positions (paper, Exp. 3)."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from tacdata.errors import FormatError, UsageError
from tacdata.paths import StrPath
from tacdata.training.scoring import published

TRUE, FALSE = {"1", "true", "yes", "success"}, {"0", "false", "no", "failure"}


@dataclass(frozen=True)
class Attempt:
    """One trial."""

    condition: str
    """Compared variant, for example the control method."""
    success: bool
    position: str = ""
    """Where it began; empty if that was not varied."""
    adjustments: int | None = None
    """Corrections before it ended; None if not counted."""


@dataclass(frozen=True)
class Rate:
    """Successes of one condition over one group of positions."""

    condition: str
    group: str
    """Name of the group; "all" for every trial."""
    successes: int
    trials: int
    interval: tuple[float, float]
    """95 % Wilson interval of the rate [1]."""
    adjustments: tuple[float, float | None] | None = None
    """Mean and sample deviation over the successful trials that counted them; None if none did."""


def rate(condition: str, group: str, attempts: list[Attempt]) -> Rate:
    """Summarize the trials of one condition and group.

    Raises:
        UsageError: If there is none.
    """
    won = [a for a in attempts if a.success]
    counted = np.array([a.adjustments for a in won if a.adjustments is not None], dtype=float)
    spread = float(counted.std(ddof=1)) if len(counted) > 1 else None
    return Rate(
        condition,
        group,
        len(won),
        len(attempts),
        _wilson(len(won), len(attempts)),
        (float(counted.mean()), spread) if len(counted) else None,
    )


def rates(attempts: list[Attempt], groups: Mapping[str, set[str]] | None = None) -> list[Rate]:
    """Return the rate of every condition over all trials, over each group of positions, and at each position.

    Args:
        attempts: The trials.
        groups: Name -> positions, for example {"edge": {"1", "2", "7", "8"}}.

    Raises:
        UsageError: If a group names a position that no trial has.
    """
    positions = list(dict.fromkeys(a.position for a in attempts if a.position))
    for name, group_positions in (groups or {}).items():
        if unknown := sorted(group_positions - set(positions)):
            raise UsageError(
                f"group {name}: positions {', '.join(unknown)} are in no trial", ", ".join(positions), "correct --group"
            )
    measured = []
    for condition in dict.fromkeys(a.condition for a in attempts):
        of_condition = [a for a in attempts if a.condition == condition]
        measured.append(rate(condition, "all", of_condition))
        parts = {**(groups or {}), **{f"position {p}": {p} for p in positions}}
        for name, group_positions in parts.items():
            if of_group := [a for a in of_condition if a.position in group_positions]:
                measured.append(rate(condition, name, of_group))
    return measured


def read_attempts(path: StrPath) -> list[Attempt]:
    """Read trials from a CSV file with columns condition, success and, if known, position and adjustments.

    Raises:
        UsageError: If there is no such file.
        FormatError: If a column or a value is missing or is none of the allowed ones; the line is named.
    """
    path = Path(path)
    if not path.is_file():
        raise UsageError(f"no file {path}", "a CSV file of trials", "check the path")
    # Excel begins a UTF-8 file with a byte order mark, which would become part of the first column's name.
    with path.open(newline="", encoding="utf-8-sig") as stream:
        table = csv.DictReader(stream)
        lacking = {"condition", "success"} - set(table.fieldnames or ())
        if lacking:
            raise FormatError(
                f"{path}: no column {', '.join(sorted(lacking))}",
                "condition, success (0 or 1), position, adjustments; the last two may be missing",
                "name the columns in the first line",
            )
        attempts = [_attempt(line, f"{path}, line {number}") for number, line in enumerate(table, start=2)]
    if not attempts:
        raise FormatError(f"{path} holds no trial", "one line a trial", "write the trials down")
    return attempts


def counted(text: str) -> Rate:
    """Return the rate of "NAME=SUCCESSES/TRIALS".

    Raises:
        UsageError: If it is not of this form, or makes no proportion.

    Example:
        >>> from tacdata.training.scoring.success import counted
        >>> rate = counted("dense=35/40")
        >>> [round(bound, 3) for bound in rate.interval]  # Wilson, 95 %
        [0.739, 0.945]
    """
    name, _, numbers = text.rpartition("=")
    successes, _, trials = numbers.partition("/")
    if not (successes.strip().isdecimal() and trials.strip().isdecimal()):
        raise UsageError(f"{text!r}", "NAME=SUCCESSES/TRIALS, for example dense=35/40", "correct it")
    won, of = int(successes), int(trials)
    return Rate(name or text, "all", won, of, _wilson(won, of))


def markdown(measured: list[Rate]) -> str:
    """Return the rates as a Markdown table."""
    with_adjustments = any(r.adjustments for r in measured)
    heads = ["Condition", "Trials", "Successes", "Rate (%)", "95 % Wilson (%)"]
    heads += ["Adjustments, mean ± SD"] if with_adjustments else []
    lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * 2 + " ---: |" * (len(heads) - 2)]
    for r in measured:
        low, high = (100 * bound for bound in r.interval)
        cells = [r.condition, r.group, f"{r.successes}/{r.trials}", f"{100 * r.successes / r.trials:.1f}"]
        cells.append(f"{low:.1f} to {high:.1f}")
        if with_adjustments:
            mean, sd = r.adjustments or (None, None)
            cells.append("–" if mean is None else f"{mean:.2f} ± " + ("–" if sd is None else f"{sd:.2f}"))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _attempt(line: dict[str, str | None], where: str) -> Attempt:
    outcome = (line["success"] or "").strip().lower()
    adjustments = (line.get("adjustments") or "").strip()
    condition = (line["condition"] or "").strip()
    if outcome not in TRUE | FALSE or not condition or (adjustments and not adjustments.isdecimal()):
        raise FormatError(
            f"{where}: condition {condition!r}, success {outcome!r}, adjustments {adjustments!r}",
            "a condition, success 0 or 1, adjustments empty or a whole number",
            "correct the line",
        )
    position = (line.get("position") or "").strip()
    return Attempt(condition, outcome in TRUE, position, int(adjustments) if adjustments else None)


def published_rates() -> list[Rate]:
    """Return the paper's counts of Exp. 3 as rates."""
    counts = []
    for condition, entry in published.SUCCESS.items():
        for group, moves in (("all", "adjustments"), ("edge", "adjustments_edge")):
            won, of = entry[group]  # ty: ignore[not-iterable]
            counts.append(Rate(condition, group, won, of, _wilson(won, of), entry.get(moves)))  # ty: ignore[invalid-argument-type]
    return counts


def _wilson(successes: int, trials: int) -> tuple[float, float]:
    if not 0 <= successes <= trials or trials < 1:
        raise UsageError(
            f"{successes} successes in {trials} trials", "0 <= successes <= trials, trials >= 1", "count again"
        )
    low, high = binomtest(successes, trials).proportion_ci(method="wilson")
    return float(low), float(high)
