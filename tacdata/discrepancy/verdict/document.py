"""The verdict as a document."""

from __future__ import annotations

from importlib import resources
from typing import Any

import numpy as np
import yaml

import schemas
from tacdata import provenance
from tacdata.chain import Course
from tacdata.discrepancy.data.clocks import clocks
from tacdata.discrepancy.data.sufficiency import FEWEST, amiss, units
from tacdata.discrepancy.data.wiring import miswired
from tacdata.discrepancy.search.detection_limits import limits
from tacdata.discrepancy.search.findings import Judgement, Member
from tacdata.discrepancy.verdict import decide
from tacdata.discrepancy.verdict.confidence import confidence, features
from tacdata.discrepancy.verdict.residual_slices import NOWHERE, Slice, in_words, outstanding
from tacdata.discrepancy.verdict.sealed import Gap
from tacdata.discrepancy.verdict.text import worsened
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
        "why": "; ".join([*wires, *odd]) or why(status, found, answer, course, shown),
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


def why(status: str, found: Judgement, answer: list[Member], course: Course, shown: Gap | None = None) -> str:
    """Return the verdict in a sentence.

    Args:
        status: none, named, ambiguous or unknown.
        found: What was found.
        answer: The effects of the answer.
        course: The recordings.
        shown: The gap on episodes that were sealed before.
    """
    names = " and ".join(m.placed.effect.title.lower() for m in answer)
    if course.episodes < FEWEST:
        return f"{course.episodes} episodes cannot carry a verdict" + (f"; so far {_best(answer)}" if answer else "")
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
        told = _best(answer)
        weak = [m.placed.effect.called for m in answer if m.necessity < m.needed]
        told += f"; {', '.join(bounds)} would need an unphysical size" if bounds else ""
        return told + (f"; more episodes must say whether {', '.join(weak)} is needed" if weak else "")
    if answer:
        return f"something is missing; {_closest(answer, found.share_left, shown)}"
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


def _closest(answer: list[Member], share: float, shown: Gap | None) -> str:
    """Return what comes closest without being the name: what it leaves, and how it fails on sealed episodes if so."""
    names = list(dict.fromkeys(m.placed.effect.called for m in answer))
    alone, told = len(names) == 1, _listed(names, "and")
    told += " comes closest and leaves" if alone else " together come closest and leave"
    told += f" {100 * share:.0f} % of what could be explained"
    it, name = ("it", "it is not the name") if alone else ("them", "they are not the names")
    if shown is not None and len(shown.before):
        before, after = float(shown.before.mean()), float(shown.after.mean())
        if worse := worsened(before, after):
            return (
                f"{told}, but sealed episodes fit {worse} with {it} (mean square {before:.3g} times the noise without, "
                f"{after:.3g} with): {name}"
            )
    return f"{told}, so {name}, or not all of it"


def _best(answer: list[Member]) -> str:
    """Return what is found, and where that is open what fits best and what may stand in for it."""
    clear = list(dict.fromkeys(m.placed.effect.called for m in answer if not m.rivals))
    groups: dict[frozenset[str], list[Member]] = {}
    for m in answer:
        if m.rivals:
            groups.setdefault(frozenset((m.placed.effect.called, *m.rivals)), []).append(m)
    told = "; ".join(_open(own) for own in groups.values())
    if not told:
        return _listed(clear, "and")
    begins = f"{_listed(clear, 'and')}, and something else: " if clear else ""
    return f"{begins}these recordings do not say which effect it is: {told}"


def _open(own: list[Member]) -> str:
    """Return effects of the answer with the same rivals, and those."""
    names = list(dict.fromkeys(m.placed.effect.called for m in own))
    others = [name for name in dict.fromkeys(r for m in own for r in m.rivals) if name not in names]
    words = f"{names[0]} fits best" if len(names) == 1 else f"{_listed(names, 'and')} together fit best"
    if others:
        return f"{words}, but {_listed(others, 'or')} may stand in for {'it' if len(names) == 1 else 'any of them'}"
    return f"{words}, but one may stand in for another"


def _listed(names: list[str], last: str) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}"


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
