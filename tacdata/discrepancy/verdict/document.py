"""The verdict as a document. It decides nothing: its content comes from `decide.py`."""

from __future__ import annotations

from importlib import resources
from typing import Any

import numpy as np
import yaml

from tacdata import provenance, schemas
from tacdata.chain import Course, predict
from tacdata.discrepancy.data.checks import DataChecks
from tacdata.discrepancy.data.sufficiency import one_rate
from tacdata.discrepancy.levels.corners import Corner
from tacdata.discrepancy.model.series_compliance import series_compliance
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.search.findings import Findings, FoundEffect
from tacdata.discrepancy.search.score_tests import DRAWS
from tacdata.discrepancy.verdict.decide import INCOMPLETE, Decided, Decision, Reason
from tacdata.discrepancy.verdict.reasons import reason_in_words
from tacdata.discrepancy.verdict.residual_slices import Slice, beside, in_words, outstanding
from tacdata.discrepancy.verdict.sealed import Gap
from tacdata.effects import Family, Whole, load

Z90 = 1.645
"""Standard errors either way of a 90 % interval."""
DIAGNOSTIC = "the diagnostic plan on this rig: `tacdata plan diagnostic --out diagnostic.yaml`"
REVISE = "`tacdata revise VERDICT RECORDING... --out NEW`"
LARGEST_LIMIT = 1e3
"""Detection limits beyond are not given [typical sizes]."""


def document(
    decision: Decision,
    findings: Findings,
    checks: DataChecks,
    sliced: tuple[list[Slice], list[Slice]],
    parents: dict[str, str],
    gap: Gap | None = None,
    confined: Corner | None = None,
) -> dict[str, Any]:
    """Return the verdict (`schemas/verdict.schema.json`).

    Args:
        decision: Status, reason and effects.
        findings: Findings of the search.
        checks: Limits and contradictions of the recordings.
        sliced: Slices of the residual before and after; empty if they were not computed.
        parents: Name of each input to its content hash.
        gap: Gap on the sealed episodes.
        confined: Where the gap lives, if it is confined to a corner.
    """
    course, placed = findings.problem.setting.course, [e.finding.placed for e in decision.effects]
    remarks_on_effects = [p.effect.remark(p.values) for p in placed]
    if any(p.effect.in_series for p in placed) and (shared := series_compliance(course)) is not None:
        remarks_on_effects.append(str(shared))
    families = {p.effect.family for p in placed}
    # An effect of the verdict that explains the lag of readings makes the remark on clocks needless.
    clocks = () if Family.DELAY_AND_FILTER in families else checks.clocks
    leads = {Family.DELAY_AND_FILTER, Family.SKIN_MEMORY, Family.FRICTION_AND_PLAY}
    clocks += () if families & leads else checks.early
    spoken = decision.reason in (Reason.ALARM, Reason.UNEXPLAINED)
    alarms = () if spoken else decision.alarms
    signs = [f"{alarm.seen}: {alarm.next}" for alarm in alarms]
    remarks = [
        *checks.wiring,
        *checks.watched,
        *signs,
        *checks.shortcomings,
        *clocks,
        *remarks_on_effects,
        *checks.base[1:],
    ]
    tests, noise, values = findings.tests, findings.problem.null.noise, max(float(findings.values.sum()), 1.0)
    return {
        "version": schemas.version("verdict"),
        "status": decision.status,
        "why": reason_in_words(decision, findings, checks, gap),
        "effects": [_effect(e, findings.final.setting) for e in decision.surest_first],
        "gate": {
            "gap": findings.gap,
            "p": float(tests.p.min(initial=1.0)),
            "p_generic": tests.p_generic,
            "noise": [float(v) for v in noise.scale],
            "memory": noise.memory,
        },
        "left": {
            "share": float(findings.share_left),
            "t": float(np.clip(findings.left.t, -99, 99)),
            "before": float(2 * findings.energy[0].sum() / values),
            "after": float(2 * findings.energy[1].sum() / values),
            "floor": 1.0,
            "families": _families(decision),
        },
        "located": located(sliced[0], findings, confined) if sliced[0] else [],
        "slices": beside(*sliced),
        "located_after": in_words(sliced[1]) if decision.status == INCOMPLETE else [],
        "path": _path(findings),
        "unjudgeable": findings.given.board.unjudgeable,
        "limits": {k: (round(v, 4) if v < LARGEST_LIMIT else None) for k, v in findings.limits.items()},
        "untested": untested([e.finding for e in decision.effects]),
        "data": {**data(course), "sealed": list(gap.names) if gap else []},
        "sealed": gap.document() if gap else {"episodes": 0, "share": 0.0, "rule": "none was sealed"},
        "remarks": [words for words in remarks if words],
        "limitations": [*checks.limitations, *checks.base[:1]],
        "next": following(decision, course, bool(checks.watched), bool(checks.base)),
        "provenance": provenance.stamp("tacdata discrepancy", parents, {"flips": DRAWS}),
    }


def _families(decision: Decision) -> dict[str, dict[str, float]]:
    """Return the lack of fit of each family."""
    return {
        family.value: {
            "size": round(lack.size, 2),
            "held_out": round(lack.gain, 2),
            "t": round(float(np.clip(lack.t, -99, 99)), 2),
        }
        for family, lack in decision.lacking.items()
    }


def _path(findings: Findings) -> list[dict[str, Any]]:
    """Return the effects in the order in which they were added, each with its share of the explained evidence."""
    evidence = {f.placed.effect.name: max(f.bought, 0.0) for f in findings.effects if np.isfinite(f.bought)}
    total = max(sum(evidence.values()) + findings.left.gain, 1e-12)
    return [
        {"effect": name, "share": evidence[name] / total if name in evidence else None}
        for name in dict.fromkeys([*findings.path, *evidence])
    ]


def located(parts: list[Slice], findings: Findings, confined: Corner | None = None) -> list[str]:
    """Return sentences on where the residual is large: a corner, single episodes, then slices of all."""
    outliers = outstanding(findings.problem.setting.course.names, findings.energy[1], findings.values)
    mean_square = 2 * float(findings.energy[0].sum()) / max(float(findings.values.sum()), 1.0)
    return in_words(parts, [*([confined.seen] if confined else []), *outliers], mean_square)


def _effect(decided: Decided, setting: Setting) -> dict[str, Any]:
    finding = decided.finding
    effect = finding.placed.effect
    parameters = {}
    for p in effect.parameters:
        value = np.asarray(finding.placed.values[p.name], dtype=float)
        error = finding.error.get(p.name)
        entry: dict[str, Any] = {"value": value.tolist(), "unit": p.unit, "error": error}
        if error is not None and value.ndim == 0:
            entry["interval"] = [float(value) - Z90 * error, float(value) + Z90 * error]
        if p.of is not None:
            entry["whole"] = _whole(p.of, setting, int(np.argmax(np.abs(value))))
        parameters[p.name] = entry
    written = {
        "mechanism": effect.called,
        "effect": effect.name,
        "title": effect.title,
        "stage": effect.stage,
        "family": effect.family.value,
        "level": decided.level and decided.level.value,
        "moves": list(effect.moves),
        "status": decided.status,
        "alternatives": list(finding.rivals),
        "parameters": parameters,
        "margins": _bounded(finding.margins),
        "necessity": float(np.clip(finding.necessity, -99, 99)),
        "at_bound": list(finding.at_bound),
        "experiment": effect.experiment,
        "features": decided.features,
        "confidence": decided.confidence,
        "forms": _bounded(finding.forms),
        "losses": finding.losses,
        # Infinite for gains of calibration, and JSON has no infinity.
        "bought": float(min(finding.bought, 1e12)),
        "selected_family": finding.selected_family,
    }
    if unphysical := [name for name in finding.unphysical if name not in finding.rivals]:
        written["unphysical"] = unphysical
    if decided.beside is not None:
        written["beside_remainder"] = {
            "necessity": decided.beside.necessity,
            "margins": _bounded(decided.beside.margins),
            "spreads": {name: round(by, 4) for name, by in decided.beside.spreads.items()},
        }
    return written


def _whole(of: Whole, setting: Setting, channel: int) -> dict[str, Any]:
    """Return the least and the largest value of a quantity that a parameter is a share of, and its unit."""
    course = setting.course
    if of is Whole.RANGE:
        swings = setting.response.swing(predict(course, setting.response, list(setting.given)).signal)[:, channel]
        return {"low": float(swings.min()), "high": float(swings.max()), "unit": "reading"}
    length = course.span if of is Whole.DEEPEST else 0.5 * course.stroke
    return {"low": length, "high": length, "unit": "mm"}


def _bounded(margins: dict[str, float]) -> dict[str, float]:
    """Return margins clipped to the range of the schema [standard errors]."""
    return {name: float(np.clip(by, -99, 99)) for name, by in margins.items()}


def untested(answer: list[FoundEffect]) -> list[str]:
    """Return known effects without a model in the answer's ambiguity groups; all of them without an answer."""
    groups = {m.placed.effect.group for m in answer}
    groups |= {load(name).group for m in answer for name in m.margins}
    listed = yaml.safe_load(resources.files("tacdata.effects").joinpath("not_modelled.yaml").read_text())
    return [f"{e['id']}: {e['title']}" for e in listed if not groups or e["group"] in groups]


def following(decision: Decision, course: Course, watched: bool = False, fitted: bool = False) -> list[str]:
    """Return the next steps, the most useful first.

    Args:
        decision: Status, reason and effects.
        course: The recordings.
        watched: Whether single channels show faults.
        fitted: Whether the response was fitted to the recordings.
    """
    if decision.reason is Reason.TOO_FEW:
        return [DIAGNOSTIC]
    if decision.reason is Reason.ALARM:
        return [alarm.next for alarm in decision.alarms]
    if decision.reason is Reason.QUIET and watched:
        return ["mend the channels that the verdict names, and record again"]
    if decision.reason is Reason.QUIET:
        words = ["nothing: below the limits in verdict.json an effect shows only in more or deeper presses"]
        return words + ["for stiffness, gain and compliance: judge again with a model (--fem or --spec)"] * fitted
    if decision.status == "named":
        return [f"add it to the model, and show the change: {REVISE}"]
    answer = [e.finding for e in decision.effects]
    words = [f"{f.placed.effect.spoken}: {f.placed.effect.experiment}" for f in answer if f.rivals or f.at_bound]
    if any(f.placed.effect.at_rest is not None and f.rivals for f in answer) and one_rate(course):
        words.insert(0, "the same presses at three rates over a decade: one rate does not split delay, play and memory")
    if decision.status == "ambiguous":
        words.append(f"the presses that settle it soonest: {REVISE} writes them as next.yaml")
    if (lone := decision.lone) is not None:
        words.append(
            f"{lone.effect.spoken}: repeat that press, best on three more places or specimens that nobody pressed "
            f"before; {lone.effect.experiment}"
        )
    if decision.reason is Reason.UNEXPLAINED:
        words += [alarm.next for alarm in decision.alarms]
    if decision.status in ("unknown", INCOMPLETE):
        words += [f"{f.placed.effect.spoken}: {f.placed.effect.experiment}" for f in answer]
        words.append(DIAGNOSTIC)
    return list(dict.fromkeys(words))


def data(course: Course) -> dict[str, Any]:
    """Return the size of the recordings, as in the verdict."""
    return {
        "episodes": course.episodes,
        "rows": len(course.read),
        "channels": course.channels,
        "channel_numbers": list(course.numbers or range(course.channels)),
        "places": len(np.unique(course.site)),
        "tools": [t.name for t in course.tools],
        "sessions": len(np.unique(course.session)),
        "force": course.force is not None,
        "tag": course.tag is not None,
        "temperature": course.temperature is not None,
        "seconds": float(course.time[-1]),
    }
