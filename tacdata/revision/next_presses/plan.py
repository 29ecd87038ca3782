"""Plans the presses that best tell rivals apart; `tacdata record` runs the plan.

Box and Hill (Technometrics 9 (1967) 57) choose the experiment with the largest expected change of the rivals'
probabilities. For Gaussian readings with the same covariance S under every rival, it has the largest sum over pairs of
pi_i pi_j d_ij' S^-1 d_ij, with d_ij the difference of their predictions.

Errors of calibration are no evidence: every channel's offset and one error of the press's depth are projected out
of d_ij first. Presses are chosen one after another. A pair counts by the logarithm of its evidence so far, so that
every pair gets its press.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tacdata import schemas
from tacdata.chain import Course, predict
from tacdata.plans import Plan
from tacdata.revision.comparison import Comparison
from tacdata.revision.next_presses.machine import MachineLimits
from tacdata.revision.next_presses.rivals import Rival
from tacdata.revision.next_presses.trial import CandidatePress, elsewhere, laid_out, predicted_readings, trials

PRESSES, REPEATS = 4, 3
"""Number of different presses, and repeats of each: the episode is the unit of all statistics."""
JITTER = 0.01
"""Expected error of a press's depth [mm]."""
STEP = 0.01
"""Step of the derivative with respect to depth [mm]."""
NOISY = 1.0
"""Whitened distance of two rivals [nats] below which a press, with all its repeats, is not informative."""
SETTLES = 4.0
"""By so many expected standard errors two rivals are distinguished; `RIVAL_Z`, with a reserve for model error [1].
"""
PLANS = 4
"""A pair that a plan settles only if it is recorded more often than this is beyond the guide [1]."""


Pair = tuple[str, str]
"""Two mechanisms."""


@dataclass(frozen=True)
class Choice:
    """One press and its purpose."""

    trial: CandidatePress
    nats: dict[Pair, float]
    """Half the whitened squared distance of each pair of rivals [nats], for one press."""

    @property
    def best(self) -> Pair:
        """The pair that it separates best."""
        return max(self.nats, key=lambda pair: self.nats[pair])


def choose(
    comparison: Comparison, candidates: list[Rival], machine: MachineLimits, presses: int = PRESSES
) -> list[Choice]:
    """Return the most informative presses, the best first; fewer if no press separates the rivals.

    Pairs that `PLANS` plans of the best press would leave open earn nothing.

    Args:
        comparison: Recordings and model.
        candidates: The rivals, fitted.
        machine: Limits of the machine that pressed.
        presses: Number of different presses.
    """
    scored = [Choice(t, _distances(comparison, candidates, t, machine)) for t in trials(comparison.course, machine)]
    weight = _probabilities(candidates)
    pairs = [(a, b) for i, a in enumerate(candidates) for b in candidates[i + 1 :]]
    have = {(a.mechanism, b.mechanism): 0.0 for a, b in pairs}
    peaks = {pair: max((c.nats[pair] for c in scored), default=0.0) for pair in have}
    # Pairs that not even several plans would settle get no press.
    have = {pair: 0.0 for pair in have if standard_errors(PLANS * presses * REPEATS * peaks[pair]) >= SETTLES}
    choices: list[Choice] = []
    while scored and len(choices) < presses:

        def worth(choice: Choice) -> float:
            # What a pair has already been given counts less and less.
            gain = [weight[i] * weight[j] * np.log1p(choice.nats[i, j] / (1.0 + have[i, j])) for i, j in have]
            return float(np.sum(gain)) / choice.trial.seconds**0.5

        best = max(scored, key=worth)
        if REPEATS * max((best.nats[pair] for pair in have), default=0.0) < NOISY:
            break
        choices.append(best)
        scored.remove(best)
        for pair in have:
            have[pair] += best.nats[pair]
    return choices


def standard_errors(nats: float) -> float:
    """Return by how many standard errors a likelihood ratio is expected to tell two models apart."""
    return float(np.sqrt(2 * nats))


def left_open(choices: list[Choice]) -> str:
    """Return the pairs that a plan of some presses will not settle, as a sentence; empty if it settles every pair."""
    sentences, beyond = [], []
    for pair in choices[0].nats:
        z = standard_errors(REPEATS * sum(c.nats[pair] for c in choices))
        # Standard errors grow with the root of the number of presses.
        plans = int(np.ceil((SETTLES / max(z, 1e-9)) ** 2))
        if plans > PLANS:
            beyond.append(f"{pair[0]} from {pair[1]}")
        elif plans > 1:
            sentences.append(f"record it {plans} times to tell {pair[0]} from {pair[1]}")
    if beyond:
        sentences.append(f"no press of this guide tells {', '.join(beyond)}: another kind of measurement is needed")
    return "; ".join(sentences)


def plan_of(
    choices: list[Choice], comparison: Comparison, plan: Plan, name: str, repeats: int = REPEATS
) -> dict[str, Any]:
    """Return the plan's document (`schemas/plan.schema.json`): every press done several times, presses in turn.

    Args:
        choices: The presses.
        comparison: Recordings and model.
        plan: The plan of one of the sessions: indenters and motion are taken over.
        name: Name of the new plan.
        repeats: Repeats of each press.
    """
    document = plan.document or {}
    used = {comparison.course.tools[c.trial.tool].name for c in choices}
    entries = []
    for turn in range(repeats):
        for c in choices:
            tool = comparison.course.tools[c.trial.tool].name
            # A tool is mounted as in the session, so that nothing else changes.
            angles = next((p.angles for p in plan.presses if p.indenter_name == tool), {"yaw": 0.0})
            purpose = f"tells {c.best[0]} from {c.best[1]}"
            entries.append({**c.trial.entry(tool, angles["yaw"]), **angles, "repeat": turn, "purpose": purpose})
    tools = list(dict.fromkeys(e["indenter"] for e in entries))
    # One mounting for each tool.
    entries.sort(key=lambda e: tools.index(e["indenter"]))
    mechanisms = list(dict.fromkeys(m for c in choices for pair in c.nats for m in pair))
    return {
        "version": schemas.version("plan"),
        "name": name,
        "purpose": f"to tell apart: {', '.join(mechanisms)}",
        "indenters": {k: v for k, v in document["indenters"].items() if k in used},
        "motion": document["motion"],
        "presses": entries,
    }


def table_of(choices: list[Choice], comparison: Comparison, repeats: int = REPEATS) -> str:
    """Return presses of a foreign machine as CSV, a row each: place, depth, speed, hold, strokes, purpose.

    Args:
        choices: The presses.
        comparison: Recordings and model.
        repeats: Repeats of each press.
    """
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    head = "x_mm y_mm depth_mm speed_mm_s hold_s recovery_s overshoot_mm strokes stroke_mm".split()
    writer.writerow(["press", "repeat", "specimen", *head, "purpose"])
    for repeat in range(repeats):
        for k, c in enumerate(choices):
            t = c.trial
            first = int(np.flatnonzero(comparison.course.site == t.site)[0])
            reference = f"as in {comparison.course.names[first]}"
            values = (t.x, t.y, t.depth, t.speed, t.hold, t.recovery, t.overshoot, t.strokes, t.stroke)
            purpose = f"distinguishes {c.best[0]} from {c.best[1]}"
            writer.writerow([k, repeat, reference, *(f"{v:.4g}" for v in values), purpose])
    return buffer.getvalue()


def _probabilities(candidates: list[Rival]) -> dict[str, float]:
    """Return each rival's probability, flattened so that none is excluded: they are rivals because none is."""
    energy = np.array([r.model.energy.sum() for r in candidates])
    weight = np.exp(-np.minimum(energy - energy.min(), 3.0))
    return {r.mechanism: float(w) for r, w in zip(candidates, weight / weight.sum(), strict=True)}


def _distances(
    comparison: Comparison, candidates: list[Rival], trial: CandidatePress, machine: MachineLimits
) -> dict[Pair, float]:
    course, noise = comparison.course, comparison.null.noise
    effects, layout = list(comparison.setting.given), laid_out(course, trial, machine)
    predicted = [
        predicted_readings(course, r.model.response, [*effects, *r.placed], trial, layout)
        / noise.scale[: course.channels]
        for r in candidates
    ]
    slope = _slope(comparison, candidates[0], trial, layout) / noise.scale[: course.channels]
    # Correlated noise is less informative: AR(1) noise of correlation m has (1 - m) / (1 + m) of the information on
    # slow differences.
    worth = (1 - noise.memory) / (1 + noise.memory)
    nats = {}
    for i, a in enumerate(candidates):
        for j in range(i + 1, len(candidates)):
            # An episode's offset is free, and its depth uncertain by `JITTER`: what these explain separates no rivals.
            difference = predicted[i] - predicted[j]
            difference = difference - difference.mean(axis=0)
            share = (difference * slope).sum() / ((slope**2).sum() + JITTER**-2)
            residual = difference - share * slope
            nats[a.mechanism, candidates[j].mechanism] = float(0.5 * worth * np.square(residual).sum())
    return nats


def _slope(comparison: Comparison, rival: Rival, trial: CandidatePress, layout: Course) -> np.ndarray:
    """Return the derivative of readings by the press's depth [counts/mm], each channel's mean subtracted."""
    response = elsewhere(rival.model.response, comparison.course, layout, trial)
    deeper = replace(layout, tip=np.where(layout.tip[:, 2:] > 0, layout.tip + np.array([0.0, 0.0, STEP]), layout.tip))
    slope = (predict(deeper, response, []).signal - predict(layout, response, []).signal)[layout.read] / STEP
    return slope - slope.mean(axis=0)
