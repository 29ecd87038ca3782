"""The next steps of a verdict, the most useful first."""

from __future__ import annotations

from tacdata.chain import Course
from tacdata.discrepancy.data.sufficiency import one_rate
from tacdata.discrepancy.report.conclusion import Conclusion, Reason, Status

DIAGNOSTIC = "the diagnostic plan on this rig: `tacdata plan diagnostic --out diagnostic.yaml`"
REVISE = "`tacdata revise VERDICT RECORDING... --out NEW`"
GIVE = f"give it to the model, and see what that changes: {REVISE}"
SETTLE = f"the presses that settle it soonest: {REVISE} writes them as next.yaml"
RATES = "the same presses at three rates over a decade: one rate splits no delay from play or memory"
LOOK = (
    "look at these presses (`tacdata view`), leave them out or record them again; of another specimen, state it "
    "(`press: {specimen: ...}` in an import's mapping)"
)


def next_steps(conclusion: Conclusion, course: Course) -> list[str]:
    """Return the next steps.

    Args:
        conclusion: What is stated.
        course: The recordings.
    """
    checks, status = conclusion.checks, conclusion.status
    if conclusion.reason is Reason.TOO_FEW:
        return [DIAGNOSTIC]
    if conclusion.reason is Reason.ODD:
        return [LOOK]
    if status is Status.NONE:
        if checks and checks.watched:
            return ["mend the channels that the verdict names, and record again"]
        words = ["nothing: below the limits in verdict.json an effect shows only in more or deeper presses"]
        fitted = bool(checks and checks.base)
        return words + ["for stiffness, gain and compliance: judge again with a model (--fem or --spec)"] * fitted
    if status is Status.NAMED:
        return [GIVE]
    words = [alarm.next for alarm in conclusion.alarms] if status is Status.UNKNOWN else []
    if conclusion.reason is Reason.ALARM:
        return words
    still = [e for e in conclusion.effects if e.alternatives]
    if any(e.placed.effect.at_rest is not None for e in still) and one_rate(course):
        words.append(RATES)
    words += [f"{e.placed.effect.spoken}: {e.placed.effect.experiment}" for e in still]
    if status is Status.AMBIGUOUS:
        words.append(SETTLE)
    if status is Status.INCOMPLETE:
        words.append(GIVE)
    if status in (Status.UNKNOWN, Status.INCOMPLETE):
        words += [f"{e.placed.effect.spoken}: {e.placed.effect.experiment}" for e in conclusion.effects]
        words.append(DIAGNOSTIC)
    return list(dict.fromkeys(words))
