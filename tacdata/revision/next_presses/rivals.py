"""Every explanation of an ambiguous verdict, each fitted to the same episodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tacdata.discrepancy.search.fits import best_shapes, fitted
from tacdata.discrepancy.search.gauss_newton import Refined, refine
from tacdata.discrepancy.search.problem import prepare
from tacdata.effects import Placed, library, load
from tacdata.revision.additions import of_verdict, placed_of
from tacdata.revision.comparison import Comparison

NEAREST = 2
"""Rivals of an effect that has no alternative."""


@dataclass(frozen=True)
class Rival:
    """One explanation of the verdict."""

    mechanism: str
    placed: tuple[Placed, ...]
    model: Refined


def rivals(
    comparison: Comparison, verdict: dict[str, Any], count: int = 6, note: Callable[[str], None] = lambda text: None
) -> list[Rival]:
    """Return the verdict's own answer, and the alternatives to its first undecided effect.

    An answer without alternatives is compared with its nearest rivals: the next presses make it surer.

    Args:
        comparison: Recordings and model.
        verdict: The verdict.
        count: Largest number of rivals.
        note: Called with the rival that is fitted.
    """
    effects = of_verdict(verdict)
    if not effects:
        return []
    # The first effect with alternatives; without any, the first of all.
    at = next((k for k, a in enumerate(effects) if a.entry["alternatives"]), 0)
    undecided = effects[at].entry
    names = (list(undecided["alternatives"]) or _nearest(undecided))[: count - 1]
    library_of = [e for e in library() if e.called in names and e.called != undecided["mechanism"]]
    if not library_of:
        return []
    placed = placed_of(effects)
    remainder = [p for k, p in enumerate(placed) if k != at]
    answer = Rival(undecided["mechanism"], tuple(placed), refine(comparison.setting, placed, comparison.null))
    setting = replace(comparison.setting, effects=library_of)
    bare = prepare(setting, comparison.null, remainder)
    everything = np.arange(len(bare.folds))
    best: dict[str, Rival] = {}
    for candidate in best_shapes(bare).values():
        note(f"next presses: {candidate.effect.name} fitted")
        _, values = fitted(bare, [candidate], everything)
        first = candidate.placed(values[: len(candidate.columns)], comparison.course.channels)
        model = refine(setting, [*remainder, first], comparison.null)
        name = candidate.effect.called
        # Of several forms of a mechanism, the one that fits best.
        if name not in best or model.energy.sum() < best[name].model.energy.sum():
            best[name] = Rival(name, model.placed, model)
    return [answer, *best.values()]


def _nearest(entry: dict[str, Any]) -> list[str]:
    """Return the mechanisms of the rivals that fit an effect's place least badly."""
    margins = sorted(entry.get("margins", {}).items(), key=lambda item: item[1])
    return list(dict.fromkeys(load(name).called for name, _ in margins))[:NEAREST]
