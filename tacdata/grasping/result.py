"""Runs the study; its result as document (`schemas/grasp_study.schema.json`) and text."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from tacdata import provenance, schemas
from tacdata.grasping.bias import bias
from tacdata.grasping.centre import Maps
from tacdata.grasping.lift import Grip, lift
from tacdata.grasping.press_set import PressSet
from tacdata.grasping.study import OTHER_FORCES, PUBLISHED, Setup, configured, lifted, rates, trials
from tacdata.grasping.touch import OrangeTouch
from tacdata.replay.comparison.paired import paired
from tacdata.sensor import Sensor

GAP = "raw_taxel", "dense_depth"
"""The two strategies whose difference is the paper's finding."""
FINENESS = 0.25
"""Resolution of the offset to which a lift holds [mm]."""


def result(
    setup: Setup,
    presses: PressSet,
    sensor: Sensor,
    maps: Maps,
    network: dict[str, Any],
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> dict[str, Any]:
    """Run a study.

    Args:
        setup: Hand, protocol and disorder; the lift presses a centred orange as hard as the measurement.
        presses: The orange's presses.
        sensor: The fingertip's sensor.
        maps: The trained network.
        network: Its identity.
        progress: Called with the number of trials done and in total.
    """
    touch, base = OrangeTouch(presses, sensor), configured(setup)
    outcomes = trials(base, touch, maps, progress)
    variants = []
    for force in OTHER_FORCES:
        variant = configured(setup, force)
        # The approach does not depend on the lift, so it is not run again.
        again = [replace(trial, held=lifted(trial, variant.grip)) for trial in outcomes]
        variants.append({"force": force, **_lifting(variant.grip), "rates": rates(again)})
    parents = {
        "sensor": sensor.content_hash,
        "checkpoint": str(network["hash"]),
        "presses": provenance.content_hash(presses.provenance["parents"]),
    }
    return {
        "version": schemas.version("grasp_study"),
        "sensor": sensor.name,
        "network": network,
        "setup": base.document,
        "lifting": {"force": setup.protocol.force, **_lifting(base.grip)},
        "rates": rates(outcomes),
        "published": PUBLISHED,
        "other_lifting": variants,
        "bias": bias(touch, presses, maps, setup.protocol.force, setup.protocol.band),
        "trials": [trial.document for trial in outcomes],
        "provenance": provenance.stamp("tacdata grasp-study", parents, {"repeats": setup.repeats, "seed": setup.seed}),
    }


def _lifting(grip: Grip) -> dict[str, float]:
    """Return the squeeze of a lifting configuration [mm], and the offset up to which it holds the undisturbed orange
    [mm].
    """
    limit = 0.0
    for offset in np.arange(0.0, 8.0, FINENESS).tolist():
        if not lift(grip, offset / 1000).held:
            break
        limit = offset
    return {"squeeze": 1000 * grip.squeeze, "holds_to": limit}


def lines(study: dict[str, Any]) -> list[str]:
    """Return a study's result as lines of text, with the paper's figures."""
    sentences = [
        f"{'':<13} {'held':>7}  {'Wilson 95 %':<14} {'paper':>6} | at the edge                   | moves where held"
    ]
    for name, strategy_rates in study["rates"].items():
        row = f"{name:<13}"
        for part in ("overall", "edge"):
            share, (low, high) = strategy_rates[part], strategy_rates[part]["wilson_95"]
            successes, of = study["published"][part].get(name, (0, 0))
            paper = f"{successes / of:.1%}" if of else "-"
            row += f" {share['held']:>3}/{share['of']:<3}  {f'{low:.0%} to {high:.0%}':<14} {paper:>6} |"
        sentences.append(
            row + f" {_moves(strategy_rates['adjustments'])}, edge {_moves(strategy_rates['edge_adjustments'])}"
        )
    return [*sentences, *_gap_lines(study), *_bias_lines(study), *_lifting_lines(study)]


def _gap_lines(study: dict[str, Any]) -> list[str]:
    """Return whether dense depth is worth more than raw taxels, as in the paper, by trials of the same oranges."""
    outcomes = {
        name: {(t["position"], t["repeat"]): t["held"] for t in study["trials"] if t["strategy"] == name}
        for name in GAP
    }
    raw, dense = (outcomes[name] for name in GAP)
    # Trials are compared in pairs: the same orange, fingertips and noise.
    if set(raw) != set(dense) or not raw:
        return []
    sentences = []
    for where, places in (("overall", None), ("edge", study["setup"]["edge"])):
        keys = [key for key in raw if places is None or key[0] in places]
        difference = paired([dense[key] for key in keys], [raw[key] for key in keys])
        low, high = difference.interval
        (raw_held, of), (dense_held, of_dense) = (study["published"][where][name] for name in GAP)
        paper = dense_held / of_dense - raw_held / of
        # The sign must be sure, and the paper's difference within the interval.
        verdict = "reproduced" if low > 0 and low <= paper <= high else "not reproduced"
        sentences.append(
            f"dense depth less raw taxels, {where}: {difference.text}; the paper's {paper:+.0%} is {verdict}"
        )
    return sentences


def _moves(moves: dict[str, Any]) -> str:
    return "none held" if moves["mean"] is None else f"{moves['mean']:.2f} +- {moves['sd']:.2f}"


def _bias_lines(study: dict[str, Any]) -> list[str]:
    measured, band = study["bias"], study["setup"]["protocol"]["band"]
    sentences = []
    labels = {"raw_taxel": "taxels", "dense_depth": "network's map", "solved_map": "solved map"}
    for name, inside in measured["toward_interior"].items():
        words = labels.get(name, name)
        deviation = ", ".join(
            f"{at} mm: {'none' if value is None else f'{value:+.2f}'}" for at, value in inside.items()
        )
        to = measured["accepted_to"][name]
        sentences.append(
            f"centre by {words}: too far inside at {deviation}; the {band:g} mm band accepts to {to:.2f} mm"
        )
    return sentences


def _lifting_lines(study: dict[str, Any]) -> list[str]:
    lifting = study["lifting"]
    sentences = [
        f"the lift presses a centred orange with {lifting['force']:g} N, as the measurement; it holds the usual one to "
        f"{lifting['holds_to']:g} mm"
    ]
    for variant in study["other_lifting"]:
        shares = {name: lifting["overall"] for name, lifting in variant["rates"].items()}
        figures = ", ".join(f"{name} {share['held']}/{share['of']}" for name, share in shares.items())
        sentences.append(f"  one with {variant['force']:g} N holds to {variant['holds_to']:g} mm: {figures}")
    return sentences
