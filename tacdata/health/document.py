"""The health of a unit as document (`schemas/health.schema.json`) and text."""

from typing import Any

import numpy as np

from tacdata import provenance, schemas
from tacdata.health import comparison
from tacdata.health.advice import Advice, advice, elsewhere, named
from tacdata.health.comparison import Change, VisitComparison
from tacdata.health.estimate import Spread, UncertainValue
from tacdata.health.gains import GainFit
from tacdata.health.history import History

DECIDING = ("tacdata.health", "tacdata.recording.check")
"""Code that decides the findings."""
MISMATCH = 1.5
"""Ratio of responses to predictions, or its inverse, beyond which the prediction is not of this unit [1]."""


def document(history: History) -> dict[str, Any]:
    """Return the document."""
    last = history.last
    return {
        "version": schemas.version("health"),
        "unit": {"sensor": last.sensor.name, "taxels": last.sensor.taxels.count, "readings": last.unit},
        "advice": [{"do": a.do, "channels": list(a.channels), "why": a.why} for a in advice(history)],
        "visits": [_visit(history, number) for number in range(len(history.visits))],
        "not_assessed": not_assessed(history),
        "remarks": remarks(history),
        "provenance": _provenance(history),
    }


def _visit(history: History, number: int) -> dict[str, Any]:
    visit, wiring, first = history.visits[number], history.wiring_at(number), history.beside_first(number)
    repeatability, errors = visit.repeatability, history.network.get(number)
    return {
        "session": visit.name,
        "started": visit.started,
        "used": [entry.recording.episode.path.name for entry in visit.entries],
        "left_out": [{"file": file, "reason": reason} for file, reason in visit.left_out],
        "labelled": bool(visit.predicted),
        "dead": list(wiring.dead),
        "swapped": [list(pair) for pair in wiring.swapped],
        "tied": [list(pair) for pair in wiring.tied],
        "undefined": list(wiring.undefined),
        "saturated": list(wiring.saturated),
        "gain_of_model": _gains(history.model[number]),
        "gain_of_first": _gains(first.gains if first else None),
        "noise": [_estimate(value) for value in visit.noise.values()],
        "zero": [_estimate(value) for value in visit.zero.values()],
        "drift": [_estimate(value) for value in visit.drift.values()],
        "loop": _estimate(visit.loop),
        "repeatability": _estimate(repeatability) if repeatability else None,
        "network_error": _estimate(errors.mean) if errors else None,
        "comparisons": [_comparison(history, each) for each in history.comparisons[number]],
    }


def _comparison(history: History, compared: VisitComparison) -> dict[str, Any]:
    changes = [_change(change) for change in compared.changes]
    return {"against": history.visits[compared.against].name, "presses": len(compared.pairs), "changes": changes}


def _gains(fit: GainFit | None) -> dict[str, Any] | None:
    if fit is None:
        return None
    return {
        "common": _estimate(fit.common),
        "channels": {str(k): _estimate(value) for k, value in fit.channels.items()},
        "shift": {name: _estimate(value) for name, value in fit.shift.items()},
    }


def _estimate(estimate: UncertainValue | Spread) -> dict[str, Any]:
    low, high = estimate.interval
    return {"value": _number(estimate.value), "low": _number(low), "high": _number(high)}


def _change(change: Change) -> dict[str, Any]:
    stated = {"quantity": change.quantity, "channel": change.channel}
    interval = {name: _number(getattr(change, name)) for name in ("value", "low", "high")}
    test = {"tolerance": _number(change.tolerance), "p": _number(change.corrected), "changed": change.changed}
    return stated | interval | {"unit": change.unit} | test


def _number(value: float) -> float | None:
    # More digits than the figures have; fewer changes between machines.
    return float(f"{value:.6g}") if np.isfinite(value) else None


def not_assessed(history: History) -> list[str]:
    """Return the quantities that the visits do not determine, and the missing recordings, as sentences."""
    last, lines = history.last, []
    if len(history.visits) > 1:
        fit = history.comparisons[-1][0].gains
        prior = history.visits[history.comparisons[-1][0].against]
        if fit is None:
            pairs = len(history.comparisons[-1][0].pairs)
            lines.append(
                f"gains: {last.name} and {prior.name} share {pairs} presses of one indenter, place, depth and speed, "
                "at three sites or more they are needed; record the same plan, or label both"
            )
        else:
            missing = sorted(set(range(last.sensor.taxels.count)) - set(fit.channels) - history.wiring.unfit)
            if missing:
                lines.append(f"gain of {named(missing)}: no press near; `tacdata plan health` presses near every taxel")
    if elsewhere(history):
        lines.append("gains: the tip stood elsewhere than before; register again and repeat the visit")
    if last.repeatability is None:
        lines.append("repeatability: no press is repeated; the plan health repeats one")
    if not np.isfinite(last.drift[0].value):
        lines.append("drift: fewer than three recordings with a rest")
    return lines


def remarks(history: History) -> list[str]:
    """Return remarks on the sessions, as sentences."""
    lines = []
    for visit, model in zip(history.visits, history.model, strict=True):
        # A nominal transduction is off for every unit: its size says nothing about this one.
        if model and not 1 / MISMATCH < model.common.value < MISMATCH:
            lines.append(
                f"{visit.name}: it responds {model.common.value:.3g} times as strongly as its labels predict: the "
                "sensor file's transduction is not that of this unit (a nominal one, or not calibrated). The size of "
                "this gain is no fault; compare visits with each other"
            )
        lines += [f"{visit.name}: {file} is left out: {reason}" for file, reason in visit.left_out]
        if visit.label_remark:
            lines.append(f"{visit.name}: {visit.label_remark}")
        if visit.session.remaining:
            lines.append(f"{visit.name}: {len(visit.session.remaining)} presses of its plan are not recorded")
    if len({visit.sensor.content_hash for visit in history.visits}) > 1:
        lines.append("the sensor file changed between visits: gains relative to the model compare two models")
    return lines


def _provenance(history: History) -> dict[str, Any]:
    parents = {}
    for visit in history.visits:
        files = {e.recording.episode.path.name: provenance.file_hash(e.recording.episode.path) for e in visit.entries}
        parents[f"recordings of {visit.name}"] = provenance.content_hash(files)
        if visit.labels:
            parents[f"labels of {visit.name}"] = provenance.content_hash(visit.labels)
    for errors in history.network.values():
        parents["network"] = errors.checkpoint
    parents["code"] = provenance.code_hash(*DECIDING)
    names = ("LEVEL", "COMMON", "OWN", "ZERO", "DRIFT", "NOISE", "LOOP", "REPEATABLE", "DEPTH", "SIDEWAYS", "NETWORK")
    return provenance.stamp("tacdata health", parents, {name.lower(): getattr(comparison, name) for name in names})


def text(history: History) -> str:
    """Return the health in some lines."""
    last, advised = history.last, advice(history)
    count = f"{len(history.visits)} visit{'s' * (len(history.visits) > 1)}"
    lines = [f"unit {last.sensor.name}, {count}, the latest {last.name} with {len(last.entries)} presses"]
    lines += [f"  {name:<14}{words}" for name, words in summary(history)]
    lines += [f"  NOT ASSESSED  {words}" for words in not_assessed(history)]
    lines += [f"  remark        {words}" for words in remarks(history)]
    return "\n".join([*lines, *headline(advised)])


def headline(advised: tuple[Advice, ...]) -> list[str]:
    """Return the advice, a line each."""
    return [f"{a.spoken.upper()}{': ' + named(a.channels) if a.channels else ''} ({a.why})" for a in advised]


def summary(history: History) -> list[tuple[str, str]]:
    """Return the latest visit's figures, each a name and words."""
    last, number = history.last, len(history.visits) - 1
    first, model = history.beside_first(number), history.model[number]
    noise = float(np.median([value.value for value in last.noise.values()]))
    tiles = []
    if first and first.gains:
        reference = history.visits[0].name
        tiles.append(("gain", f"{_percent(first.gains.common)} of that at {reference}, all channels (median)"))
    if model:
        tiles.append(("gain of model", f"{_percent(model.common)} of what labels predict, all channels (median)"))
    tiles.append(("noise", f"{noise:.3g} {last.unit} (median of the channels)"))
    tiles.append(("loop", f"{_percent(last.loop)} of depth times response"))
    if repeated := last.repeatability:
        low, high = (100 * bound for bound in repeated.interval)
        tiles.append(("repeatability", f"{100 * repeated.value:.1f} % ({low:.1f} to {high:.1f})"))
    if errors := history.network.get(number):
        low, high = errors.mean.interval
        tiles.append(("network", f"error in contact {errors.mean.value:.3f} mm ({low:.3f} to {high:.3f})"))
    return tiles


def _percent(estimate: UncertainValue) -> str:
    low, high = (100 * bound for bound in estimate.interval)
    return f"{100 * estimate.value:.1f} % ({low:.1f} to {high:.1f})"
