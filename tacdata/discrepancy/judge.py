"""From recordings, read already, and a spec to a verdict: some episodes sealed, the others judged, the gap shown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tacdata.chain import Course
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.model.spec import Spec
from tacdata.discrepancy.search.findings import Judgement
from tacdata.discrepancy.search.judge import judge
from tacdata.discrepancy.verdict import document
from tacdata.discrepancy.verdict.residual_slices import Slice, residual, slices
from tacdata.discrepancy.verdict.sealed import chosen, gap, without_readings
from tacdata.effects import library


@dataclass(frozen=True)
class Judged:
    """A verdict and what it rests on."""

    verdict: dict[str, Any]
    """As in the file (`schemas/verdict.schema.json`)."""
    found: Judgement
    before: list[Slice]
    """Where the residual lives, in the episodes that were not sealed."""
    after: list[Slice]
    """The same with the effects in place."""


def judged(
    course: Course, spec: Spec, note: Callable[[str], None] = lambda text: None,
    parents: dict[str, str] | None = None, without: tuple[str, ...] = (), until: str = "decide", decoys: bool = True,
) -> Judged:  # fmt: skip
    """Judge recordings.

    Args:
        course: The recordings.
        spec: The model.
        note: Is told what is being done.
        parents: Name to content hash of what is judged.
        without: Mechanisms that are not tried.
        until: The last step to make (`tacdata.discrepancy.search.judge.STEPS`).
        decoys: Whether effects race with copies of all whose scores are chance.

    Raises:
        FormatError: If recordings and spec do not fit together.
    """
    sealed = chosen(course)
    open_ = without_readings(course, sealed)
    response, placed = spec.response(open_), spec.effects()
    left_out = {p.effect.called for p in placed} | set(without)
    effects = [e for e in library() if e.called not in left_out]
    found = judge(Setting(open_, response, effects, spec.nuisance, placed, decoys), note, until)
    note("the gap on sealed episodes")
    before, after = slices(found.problem, residual(found.problem)), slices(found.final, residual(found.final))
    shown = gap(course, response, found, sealed)
    answer = document.document(found, before, parents or {}, shown)
    return Judged(answer, found, before, after)
