"""From recordings and a model to a verdict: the workflow, in one direction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tacdata.chain import Course
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.model.spec import Spec
from tacdata.discrepancy.report.conclusion import Conclusion, Step
from tacdata.discrepancy.report.document import document
from tacdata.discrepancy.report.judgement import concluded, open_course
from tacdata.discrepancy.report.residual_slices import Slice, slices
from tacdata.effects import library


@dataclass(frozen=True)
class Verdict:
    """A verdict and its basis."""

    document: dict[str, Any]
    """As in the file (`schemas/verdict.schema.json`)."""
    conclusion: Conclusion
    """What it states, and the evidence."""
    before: list[Slice]
    """Residual by slices of the presses that were not sealed; empty where the gate was the last step."""
    after: list[Slice]
    """The same with the effects in place."""


def judge(
    course: Course,
    spec: Spec,
    note: Callable[[str], None] = lambda text: None,
    parents: dict[str, str] | None = None,
    without: tuple[str, ...] = (),
    until: Step = Step.DECIDE,
) -> Verdict:
    """Judge recordings: which effect does the model lack?

    1. Seal some presses: the search does not use their readings.
    2. Check the data: wiring, units, gaps.
    3. Compute the posterior over sets of effects (`tacdata.discrepancy.posterior`).
    4. Test the residual for patterns outside the library: alarms.
    5. Open the sealed presses: they can take a name away, and never give one.
    6. Conclude: named, incomplete, ambiguous, unknown or none. Write it all down.

    Args:
        course: The recordings.
        spec: The model.
        note: Called with each step.
        parents: Name to content hash of the judged files.
        without: Mechanisms that are not tried.
        until: The last step to make.

    Raises:
        FormatError: If recordings and spec do not fit together.
    """
    opened = open_course(course)
    conclusion = concluded(course, _setting(opened, spec, without), note, until=until)
    fits = [fit for fit in (conclusion.before, conclusion.after) if fit is not None and until != Step.GATE]
    before, after = (slices(fit.problem) for fit in fits) if fits else ([], [])
    return Verdict(document(conclusion, opened, (before, after), parents or {}), conclusion, before, after)


def _setting(course: Course, spec: Spec, without: tuple[str, ...]) -> Setting:
    """Return the setting of a judgement: all effects are tried that the model has not."""
    response, given = spec.response(course), spec.effects()
    left_out = {p.effect.called for p in given} | set(without)
    effects = [e for e in library() if e.called not in left_out]
    return Setting(course, response, effects, spec.nuisance, given)
