"""Every explanation of an ambiguous verdict, each fitted to the same episodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.search.fits import best_shapes, fitted
from tacdata.discrepancy.search.gauss_newton import Refined, refine
from tacdata.discrepancy.search.problem import prepare
from tacdata.effects import Placed, library, load
from tacdata.revision.comparison import Comparison


@dataclass(frozen=True)
class Rival:
    """One explanation of the verdict."""

    mechanism: str
    placed: tuple[Placed, ...]
    model: Refined


def named(verdict: dict[str, Any]) -> list[Placed]:
    """Return the effects of a verdict with their parameters."""
    return [
        Placed(load(e["effect"]), {n: np.array(p["value"], dtype=float) for n, p in e["parameters"].items()})
        for e in verdict["effects"]
    ]


def rivals(
    held: Comparison, verdict: dict[str, Any], most: int = 6, note: Callable[[str], None] = lambda text: None
) -> list[Rival]:
    """Return the verdict's own answer, and the alternatives to its first undecided effect.

    Args:
        held: Recordings and model.
        verdict: An ambiguous verdict.
        most: Largest number of rivals.
        note: Called with the rival that is fitted.
    """
    own = named(verdict)
    at = next((k for k, e in enumerate(verdict["effects"]) if e["alternatives"]), None)
    if at is None or not own:
        return []
    kept = [p for k, p in enumerate(own) if k != at]
    found = [Rival(verdict["effects"][at]["mechanism"], tuple(own), refine(held.setting, own, held.null))]
    wanted = list(verdict["effects"][at]["alternatives"])[: most - 1]
    known = [e for e in library() if e.called in wanted]
    setting = Setting(held.course, held.setting.response, known, held.setting.nuisance, held.setting.given)
    bare = prepare(setting, held.null, kept)
    everything = np.arange(len(bare.folds))
    best: dict[str, Rival] = {}
    for candidate in best_shapes(bare).values():
        note(f"next presses: {candidate.effect.name} fitted")
        _, values = fitted(bare, [candidate], everything)
        first = candidate.placed(values[: len(candidate.columns)], held.course.channels)
        model = refine(setting, [*kept, first], held.null)
        called = candidate.effect.called
        if called not in best or model.energy.sum() < best[called].model.energy.sum():
            best[called] = Rival(called, model.placed, model)
    return [*found, *best.values()]
