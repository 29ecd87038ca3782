"""The conclusion as a document (`schemas/verdict.schema.json`). It decides nothing."""

from __future__ import annotations

from importlib import resources
from typing import Any

import numpy as np
import yaml

from tacdata import provenance, schemas
from tacdata.chain import Course
from tacdata.discrepancy.data.checks import DataChecks
from tacdata.discrepancy.model.series_compliance import series_compliance
from tacdata.discrepancy.posterior.estimates import Estimate
from tacdata.discrepancy.report.conclusion import Conclusion, Named, Reason, SetProbability, Status
from tacdata.discrepancy.report.next_steps import next_steps
from tacdata.discrepancy.report.residual_slices import Slice, beside, in_words, outstanding
from tacdata.discrepancy.report.sentence import sentence_of
from tacdata.effects import Family, load

LARGEST_LIMIT = 1e3
"""Detection limits beyond are not given [typical sizes]."""


def document(
    conclusion: Conclusion, course: Course, sliced: tuple[list[Slice], list[Slice]], parents: dict[str, str]
) -> dict[str, Any]:
    """Return the verdict (`schemas/verdict.schema.json`).

    Args:
        conclusion: What is stated.
        course: The recordings, without the readings of sealed presses.
        sliced: Slices of the residual before and after.
        parents: Name of each input to its content hash.
    """
    checks, sealed, policy = conclusion.checks or DataChecks(course.episodes), conclusion.sealed, conclusion.policy
    unfinished = conclusion.status in (Status.INCOMPLETE, Status.UNKNOWN)
    return {
        "version": schemas.version("verdict"),
        "status": conclusion.status.value,
        "why": sentence_of(conclusion, course),
        "effects": [_effect(e, conclusion) for e in conclusion.surest_first],
        "posterior": {
            "nothing": conclusion.nothing,
            "remainder": conclusion.remainder,
            "mechanisms": dict(conclusion.mechanisms),
            "families": dict(conclusion.families),
            "sets": [_set(one) for one in conclusion.sets],
            "policy": policy.document(),
            "policy_hash": policy.content_hash,
        },
        "gap": _gap(conclusion),
        "located": _located(conclusion, course, sliced[0]) if sliced[0] else [],
        "slices": beside(*sliced),
        "located_after": in_words(sliced[1]) if unfinished and conclusion.effects and sliced[1] else [],
        "unjudgeable": conclusion.given.board.unjudgeable if conclusion.given else {},
        "limits": {k: (round(v, 4) if v < LARGEST_LIMIT else None) for k, v in conclusion.limits.items()},
        "untested": untested(conclusion),
        "data": {**_data(course), "sealed": list(sealed.names) if sealed else []},
        "sealed": sealed.document() if sealed else {"episodes": 0, "share": 0.0, "rule": "none was sealed"},
        "remarks": _remarks(conclusion, course, checks),
        "limitations": [*checks.limitations, *checks.base[:1]],
        "next": next_steps(conclusion, course),
        "provenance": provenance.stamp("tacdata discrepancy", parents, {"policy": policy.content_hash}),
    }


def _gap(conclusion: Conclusion) -> dict[str, Any]:
    """Return the size of the residual before and after, and the noise that it is compared with."""
    fits = [fit for fit in (conclusion.before, conclusion.after) if fit is not None]
    written: dict[str, Any] = {"seen": conclusion.nothing < conclusion.policy.none, "floor": 1.0}
    for name, fit in zip(("before", "after"), fits, strict=False):
        written[name] = float(2 * fit.energy.sum() / max(float(fit.problem.grams.rows.sum()), 1.0))
    if fits:
        noise = fits[0].problem.null.noise
        written |= {"noise": [float(v) for v in noise.scale], "memory": noise.memory}
    return written


def _remarks(conclusion: Conclusion, course: Course, checks: DataChecks) -> list[str]:
    """Return remarks on the recordings; those that an effect of the verdict explains are left out."""
    effects = [e.placed.effect for e in conclusion.effects]
    own = [e.placed.effect.remark(e.placed.values) for e in conclusion.effects]
    if any(e.in_series for e in effects) and (shared := series_compliance(course)) is not None:
        own.append(str(shared))
    families = {e.family for e in effects}
    clocks = () if Family.DELAY_AND_FILTER in families else checks.clocks
    leads = {Family.DELAY_AND_FILTER, Family.SKIN_MEMORY, Family.FRICTION_AND_PLAY}
    clocks += () if families & leads else checks.early
    stated = conclusion.reason is Reason.ALARM or (conclusion.status is Status.UNKNOWN and not conclusion.effects)
    signs = [] if stated else [f"{alarm.seen}: {alarm.next}" for alarm in conclusion.alarms]
    words = [*checks.wiring, *checks.watched, *signs, *checks.shortcomings, *clocks, *own, *checks.base[1:]]
    return [remark for remark in words if remark]


def _located(conclusion: Conclusion, course: Course, parts: list[Slice]) -> list[str]:
    """Return sentences on where the residual is large: single presses, then slices of all."""
    before, after = conclusion.before, conclusion.after
    if before is None or after is None:
        return in_words(parts)
    values = before.problem.grams.rows
    outliers = outstanding(course.names, after.energy, values)
    return in_words(parts, outliers, 2 * float(before.energy.sum()) / max(float(values.sum()), 1.0))


def _effect(one: Named, conclusion: Conclusion) -> dict[str, Any]:
    effect = one.placed.effect
    return {
        "mechanism": effect.called,
        "effect": effect.name,
        "title": effect.title,
        "stage": effect.stage,
        "family": effect.family.value,
        "level": one.level and one.level.value,
        "moves": list(effect.moves),
        "status": one.certainty.value,
        "probability": {"family": one.family, "mechanism": one.probability, "form": one.form},
        "by_calibration": one.by_calibration,
        "alternatives": list(one.alternatives),
        "rivals": rivals(one, conclusion),
        "parameters": {name: _estimate(estimate) for name, estimate in one.estimates.items()},
        "experiment": effect.experiment,
    }


def rivals(one: Named, conclusion: Conclusion) -> dict[str, float]:
    """Return the mechanisms of sets without an effect, each with their probability, the most probable first [1]."""
    called, inside = one.placed.effect.called, {e.placed.effect.called for e in conclusion.effects}
    shares: dict[str, float] = {}
    for each in conclusion.sets:
        names = {p.effect.called for p in each.placed}
        if called not in names:
            for name in names - inside:
                shares[name] = shares.get(name, 0.0) + each.probability
    return dict(sorted(shares.items(), key=lambda item: -item[1]))


def _estimate(estimate: Estimate) -> dict[str, Any]:
    """Return a parameter: value, largest standard error, and the interval of a single number."""
    known = np.isfinite(estimate.error).all() and bool(np.any(estimate.error > 0))
    written: dict[str, Any] = {
        "value": np.asarray(estimate.value, dtype=float).tolist(),
        "unit": estimate.unit,
        "error": float(np.max(estimate.error)) if known else None,
        "at_bound": estimate.at_bound,
    }
    if known and np.ndim(estimate.value) == 0:
        written["interval"] = [float(end) for end in estimate.interval]
    return written


def _set(one: SetProbability) -> dict[str, Any]:
    return {
        "effects": [p.effect.name for p in one.placed],
        "probability": one.probability,
        "log_evidence": one.log_evidence,
        "parameters": [{name: np.asarray(v, dtype=float).tolist() for name, v in p.values.items()} for p in one.placed],
    }


def untested(conclusion: Conclusion) -> list[str]:
    """Return known effects without a model in the answer's ambiguity groups; all of them without an answer."""
    groups = {e.placed.effect.group for e in conclusion.effects}
    groups |= {load(name).group for e in conclusion.effects for name in e.alternatives}
    listed = yaml.safe_load(resources.files("tacdata.effects").joinpath("not_modelled.yaml").read_text())
    return [f"{e['id']}: {e['title']}" for e in listed if not groups or e["group"] in groups]


def _data(course: Course) -> dict[str, Any]:
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
