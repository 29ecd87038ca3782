"""The verdict as a document, and in words."""

from __future__ import annotations

from importlib import resources
from typing import Any

import numpy as np
import yaml

import schemas
from tacdata import provenance
from tacdata.chain import Course
from tacdata.discrepancy import decide
from tacdata.discrepancy.amiss import FEWEST, amiss, units
from tacdata.discrepancy.clocks import clocks
from tacdata.discrepancy.confidence import confidence, features
from tacdata.discrepancy.judgement import Judgement, Member
from tacdata.discrepancy.limits import limits
from tacdata.discrepancy.located import NOWHERE, Slice, in_words, outstanding
from tacdata.discrepancy.sealed import Gap
from tacdata.discrepancy.wiring import miswired
from tacdata.effects import load

FITTED = (
    "the base was fitted to these recordings and takes up all that has no memory (stiffness, gain, thickness, offsets, "
    "compliance): such effects need a model of the sensor (--spec, --fem), or for compliance a gauge at the tip"
)
Z90 = 1.645
"""Standard errors either way of a 90 % interval."""


def document(
    found: Judgement, sliced: list[Slice], parents: dict[str, str], shown: Gap | None = None
) -> dict[str, Any]:
    """Return the verdict (`schemas/verdict.schema.json`).

    Args:
        found: What was found.
        sliced: Where the residual lives, before anything is added.
        parents: Name to content hash of what was judged.
        shown: The gap on episodes that were sealed before.
    """
    course = found.problem.setting.course
    answer, status = decide.members(found), decide.status(found)
    late = [float(m.placed.values["L"]) for m in answer if m.placed.effect.name == "latency"]
    remarks = [*amiss(course), *clocks({m.placed.effect.called for m in answer}, max(late, key=abs, default=0.0))]
    if found.problem.setting.response.fitted:
        remarks.append(FITTED)
    wires = miswired(course, found.problem.setting.response) if not found.problem.setting.given else []
    remarks = [*wires, *remarks]
    odd = units(course)
    if course.episodes < FEWEST or wires or odd:
        status = "unknown"
    effects = [_effect(m, status, features(found, m, len(answer))) for m in answer]
    tested = found.tested
    values = max(float(found.values.sum()), 1.0)
    return {
        "version": schemas.version("verdict"), "status": status,
        "why": "; ".join([*wires, *odd]) or why(status, found, answer, course),
        "effects": effects,
        "gate": {"gap": found.gap, "p": float(tested.p.min(initial=1.0)), "p_generic": tested.p_generic,
                 "noise": [float(v) for v in found.problem.frame.noise.scale],
                 "memory": found.problem.frame.noise.memory},
        "left": {"share": float(found.share_left), "t": float(np.clip(found.left.t, -99, 99)),
                 "before": float(2 * found.energy[0].sum() / values),
                 "after": float(2 * found.energy[1].sum() / values), "floor": 1.0},
        "located": _located(sliced, found, course), "unjudgeable": found.problem.board.unjudgeable,
        "limits": {k: (round(v, 4) if np.isfinite(v) and v < 1e3 else None) for k, v in limits(found.final).items()},
        "untested": untested(answer), "data": {**data(course), "sealed": list(shown.names) if shown else []},
        "sealed": shown.document() if shown else {"episodes": 0, "share": 0.0, "rule": "none was sealed"},
        "remarks": remarks, "next": following(answer, status),
        "provenance": provenance.stamp("tacdata discrepancy", parents, {"flips": 999}),
    }  # fmt: skip


def _located(sliced: list[Slice], found: Judgement, course: Course) -> list[str]:
    alone = outstanding(course.names, found.energy[1], found.values)
    words = in_words(sliced)
    return [*alone, *(w for w in words if not (alone and w == NOWHERE))]


def _effect(member: Member, verdict: str, told: dict[str, float]) -> dict[str, Any]:
    # Whoever reads the effects alone must not take for a name what the verdict refuses to name.
    status = "suspected" if verdict == "unknown" else decide.settled(member)
    effect = member.placed.effect
    parameters = {}
    for p in effect.parameters:
        value = np.asarray(member.placed.values[p.name], dtype=float)
        error = member.error.get(p.name)
        entry: dict[str, Any] = {"value": value.tolist(), "unit": p.unit, "error": error}
        if error is not None and value.ndim == 0:
            entry["interval"] = [float(value) - Z90 * error, float(value) + Z90 * error]
        parameters[p.name] = entry
    return {
        "mechanism": effect.called, "effect": effect.name, "title": effect.title, "stage": effect.stage,
        "moves": list(effect.moves), "status": status, "alternatives": list(member.rivals),
        "parameters": parameters, "margins": {k: float(np.clip(v, -99, 99)) for k, v in member.margins.items()},
        "necessity": float(np.clip(member.necessity, -99, 99)), "at_bound": list(member.at_bound),
        "experiment": effect.experiment, "features": told,
        "confidence": confidence(told) if status == "named" else None,
    }  # fmt: skip


def why(status: str, found: Judgement, answer: list[Member], course: Course) -> str:
    """Return the verdict in a sentence."""
    names = " and ".join(m.placed.effect.title.lower() for m in answer)
    sets = _sets(answer)
    if course.episodes < FEWEST:
        return f"{course.episodes} episodes cannot carry a verdict" + (f"; they point to {sets}" if answer else "")
    if found.until != "decide":
        fitted = f"; {names} fits best, rivals were not tried" if answer else ""
        return f"stopped after {found.until}: {'a gap' if found.gap else 'no gap'}{fitted}"
    if status == "none":
        return "nothing is missing that these recordings would show; see the detection limits"
    if status == "named":
        more = "" if found.left.t < decide.LEFT_T else f"; {100 * found.share_left:.1f} % of it is another form"
        return f"{names}: nothing else explains the episodes as well{more}"
    if status == "ambiguous":
        bounds = [m.placed.effect.called for m in answer if m.at_bound]
        told = f"these recordings cannot tell {sets} apart" if any(m.rivals for m in answer) else f"{sets}"
        weak = [m.placed.effect.called for m in answer if m.necessity < m.needed]
        told += f"; {', '.join(bounds)} would need an unphysical size" if bounds else ""
        return told + (f"; more episodes must say whether {', '.join(weak)} is needed" if weak else "")
    if answer:
        closest = " with ".join(m.placed.effect.called for m in answer)
        return (
            f"something is missing; {closest} comes closest and leaves {100 * found.share_left:.0f} % of what could be "
            "explained, so it is not the name, or not all of it"
        )
    if len(odd := found.problem.frame.odd):
        names = [course.names[k] for k in odd]
        told = ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
        return (
            f"{told}: unlike all other presses of their place, and no effect explains them: was something touched or "
            "moved? Look at them (`tacdata view`), leave them out or record them again"
        )
    if not found.gap:
        return (
            f"readings are off by {decide.loudness(found):.1f} times the noise, but no effect is borne out by several "
            "episodes: look at where it lives"
        )
    return "something is missing that no modelled effect explains"


def _sets(answer: list[Member]) -> str:
    """Return what each effect may be; effects that may be the same are told of once."""
    groups: dict[frozenset[str], list[Member]] = {}
    for m in answer:
        groups.setdefault(frozenset((m.placed.effect.called, *m.rivals)), []).append(m)
    told = []
    for own in groups.values():
        words = " or ".join((own[0].placed.effect.called, *own[0].rivals))
        told.append(words if len(own) == 1 else f"{len(own)} effects, each of them {words}")
    return "; ".join(told)


def untested(answer: list[Member]) -> list[str]:
    """Return effects that are known and not modelled, of the answer's ambiguity groups; all, without an answer."""
    groups = {m.placed.effect.group for m in answer}
    groups |= {load(name).group for m in answer for name in m.margins}
    listed = yaml.safe_load(resources.files("tacdata.effects").joinpath("not_modelled.yaml").read_text())
    return [f"{e['id']}: {e['title']}" for e in listed if not groups or e["group"] in groups]


def following(answer: list[Member], status: str) -> list[str]:
    """Return experiments, the most useful first."""
    told = [f"{m.placed.effect.called}: {m.placed.effect.experiment}" for m in answer if m.rivals or m.at_bound]
    if status == "unknown":
        told += [f"{m.placed.effect.called}: {m.placed.effect.experiment}" for m in answer]
        told.append("the diagnostic plan on this rig: `tacdata plan diagnostic --out diagnostic.yaml`")
    return list(dict.fromkeys(told))


def data(course: Course) -> dict[str, Any]:
    """Return what was judged, in numbers."""
    return {
        "episodes": course.episodes, "rows": len(course.read), "channels": course.channels,
        "channel_numbers": list(course.numbers or range(course.channels)),
        "places": len(np.unique(course.site)), "tools": [t.name for t in course.tools],
        "sessions": len(np.unique(course.session)), "force": course.force is not None, "tag": course.tag is not None,
        "temperature": course.temperature is not None, "seconds": float(course.time[-1]),
    }  # fmt: skip


def in_text(verdict: dict[str, Any]) -> str:
    """Return a verdict for reading."""
    lines = [f"{verdict['status'].upper()}: {verdict['why']}", ""]
    for e in verdict["effects"]:
        sure = "" if e["confidence"] is None or e["status"] != "named" else f", {100 * e['confidence']:.0f} % sure"
        lines.append(f"  {e['mechanism']} ({e['effect']}, {e['stage']}): {e['status']}{sure}")
        for name, p in e["parameters"].items():
            if isinstance(p["value"], list):
                lines.append(
                    f"    {name}: {min(p['value']):.4g} to {max(p['value']):.4g} {p['unit']} over the channels"
                )
            else:
                spread = f" +- {p['error']:.2g}" if p["error"] is not None else ""
                lines.append(f"    {name} = {p['value']:.4g}{spread} {p['unit']}")
        if e["margins"]:
            shown = ", ".join(f"{k} {v:.1f}" for k, v in sorted(e["margins"].items(), key=lambda kv: kv[1])[:6])
            lines.append(f"    better, in standard errors over episodes, than: {shown}")
    gate, left = verdict["gate"], verdict["left"]
    lines += ["", f"gate: p = {gate['p']:.3f} over all effects, {gate['p_generic']:.3f} for patterns of no effect"]
    lines.append(f"residual: {left['before']:.3f} before, {left['after']:.3f} after; 1 is the noise floor")
    lines.append(f"left of what could be explained: {100 * left['share']:.1f} % ({left['t']:.1f} standard errors)")
    sealed = verdict["sealed"]
    if sealed["episodes"]:
        lines.append(
            f"{sealed['episodes']} sealed episodes: {sealed['before']:.3f} before, {sealed['after']:.3f} after, "
            f"{sealed['ceiling']:.3f} at best; {100 * sealed['closed']:.0f} % of the gap closed "
            f"(90 %: {100 * sealed['interval'][0]:.0f} to {100 * sealed['interval'][1]:.0f} %)"
        )
    lines += ["where it lives:", *(f"  {words}" for words in verdict["located"])]
    if verdict["next"]:
        lines += ["next:", *(f"  {words}" for words in verdict["next"])]
    if verdict["remarks"]:
        lines += ["of these recordings:", *(f"  {words}" for words in verdict["remarks"])]
    lines.append("cannot be judged here: " + ", ".join(sorted(verdict["unjudgeable"])))
    weak = [k for k, v in verdict["limits"].items() if v is None or v > 3]
    if weak:
        lines.append("would be seen only at more than three times their usual size: " + ", ".join(sorted(weak)))
    if verdict["untested"]:
        lines.append("known, not modelled: " + "; ".join(verdict["untested"][:12]))
    return "\n".join(lines) + "\n"
