"""The workflow from recordings and a model to a verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from threadpoolctl import threadpool_limits

from tacdata.chain import Course
from tacdata.discrepancy.alarms.all_alarms import alarms
from tacdata.discrepancy.data.checks import DataChecks, check
from tacdata.discrepancy.levels.corners import corner
from tacdata.discrepancy.levels.lack_of_fit import lack_of_fit, with_families
from tacdata.discrepancy.levels.margins import beside_remainder
from tacdata.discrepancy.levels.several_names import form_error
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.model.spec import Spec
from tacdata.discrepancy.search.find import find
from tacdata.discrepancy.search.findings import STEPS, Findings
from tacdata.discrepancy.verdict.decide import Decision, adequate, answer_of, decide
from tacdata.discrepancy.verdict.document import document
from tacdata.discrepancy.verdict.residual_slices import Slice, slices
from tacdata.discrepancy.verdict.sealed import chosen, gap, without_readings
from tacdata.effects import library


@dataclass(frozen=True)
class Verdict:
    """A verdict and its basis."""

    document: dict[str, Any]
    """As in the file (`schemas/verdict.schema.json`)."""
    checks: DataChecks
    """Checks of the recordings' information."""
    found: Findings
    """Findings of the search."""
    decision: Decision
    """Decision on them."""
    before: list[Slice]
    """Where the residual lives, in the episodes that were not sealed; empty where the gate was the last step."""
    after: list[Slice]
    """The same with the effects in place."""


# Threads wait for each other at matrices of a few hundred rows: two took twice the time of one.
@threadpool_limits.wrap(limits=1, user_api="blas")
def judge(
    course: Course,
    spec: Spec,
    note: Callable[[str], None] = lambda text: None,
    parents: dict[str, str] | None = None,
    without: tuple[str, ...] = (),
    until: str = "decide",
    correct_p: bool = True,
) -> Verdict:
    """Judge recordings: which effect does the model lack?

    1. Seal some episodes: the search does not use their readings.
    2. Check the data: wiring, units, gaps.
    3. Find: regressors, noise, gate, race, elimination, rivals, leftovers (`tacdata.discrepancy.search.find`).
    4. Compare the answer with the saturated model of each family: does another law explain more?
    5. Test the residual for patterns outside the library, and for effects of one corner: alarms.
    6. Open the sealed episodes: how much smaller is their gap?
    7. Decide: named (all of it, or some with a remainder left), ambiguous, unknown or none. Sealed episodes can take a
       name away; they never give one.
    8. Write it all down.

    Args:
        course: The recordings.
        spec: The model.
        note: Called with each step.
        parents: Name to content hash of the judged files.
        without: Mechanisms that are not tried.
        until: The last step to make (`tacdata.discrepancy.search.findings.STEPS`).
        correct_p: Whether p-values are corrected for the number of effects tried.

    Raises:
        FormatError: If recordings and spec do not fit together.
    """
    sealed = chosen(course)
    setting = _setting(without_readings(course, sealed), spec, without, correct_p)
    checks = check(setting)
    findings = find(setting, note, until)
    until = findings.until
    lacking = lack_of_fit(findings.final) if findings.effects and until == STEPS[-1] else {}
    findings = with_families(findings, lacking)
    evidence = () if adequate(findings, answer_of(findings)) else beside_remainder(findings)
    note("the gap on sealed presses")
    sealed_gap = gap(course, findings, sealed)
    confined = corner(findings.given, findings.explained) if until == STEPS[-1] else None
    raised = alarms(findings.final, form_error(findings)) if until == STEPS[-1] else ()
    if confined is not None and not findings.effects:
        raised = (confined.alarm, *raised)
    decision = decide(findings, checks, evidence, sealed_gap, lacking, raised)
    slices_before, slices_after = ([], []) if until == "gate" else (slices(findings.problem), slices(findings.final))
    sliced = slices_before, slices_after
    written = document(decision, findings, checks, sliced, parents or {}, sealed_gap, confined)
    return Verdict(written, checks, findings, decision, slices_before, slices_after)


def _setting(course: Course, spec: Spec, without: tuple[str, ...], correct_p: bool) -> Setting:
    """Return the setting of a judgement: all effects are tried that the model has not."""
    response, model_effects = spec.response(course), spec.effects()
    left_out = {p.effect.called for p in model_effects} | set(without)
    effects = [e for e in library() if e.called not in left_out]
    return Setting(course, response, effects, spec.nuisance, model_effects, correct_p)
