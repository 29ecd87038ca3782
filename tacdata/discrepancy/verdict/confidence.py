"""Confidence in a name: a probability, by a map fitted to simulated worlds with a known truth."""

from __future__ import annotations

import json
from functools import lru_cache
from importlib import resources
from typing import Any

import numpy as np

from tacdata.discrepancy.search.findings import Findings, FoundEffect

FILE = "confidence.json"
"""The map: weights, and the worlds and the command that they come from."""
LARGEST_Z = 12.0
"""Larger margins are clipped to this [standard errors]."""


def features(findings: Findings, finding: FoundEffect, count: int) -> dict[str, float]:
    """Return the features of an effect's confidence, each about 0 to 1.

    Args:
        findings: Findings of the search.
        finding: One effect of the answer.
        count: Number of effects in the answer.
    """
    p = finding.corrected_p
    margin = min((float(v) for v in finding.margins.values()), default=LARGEST_Z)
    return {
        "margin": float(np.clip(margin, 0, LARGEST_Z)) / LARGEST_Z,
        "need": float(np.clip(finding.necessity, 0, LARGEST_Z)) / LARGEST_Z,
        "selected": finding.selected,
        "decoys": 1.0 if p is None else float(np.clip(-np.log10(max(p, 1e-3)) / 3, 0, 1)),  # the file's name for it
        "explained": 1 - float(np.clip(findings.share_left, 0, 1)),
        "left": float(np.clip(findings.left.t, 0, LARGEST_Z)) / LARGEST_Z,
        "others": (count - 1) / 3,
        "episodes": float(np.clip(np.log10(len(findings.energy[0])) / 2, 0, 1)),
    }


def confidence(values: dict[str, float]) -> float | None:
    """Return the probability that a name with such features is right; None without a map."""
    weights = known()
    if weights is None:
        return None
    score = weights["intercept"] + sum(w * values.get(name, 0.0) for name, w in weights["weights"].items())
    low, high = weights["range"]
    return float(np.clip(1 / (1 + np.exp(-score)), low, high))


@lru_cache(maxsize=1)
def known() -> dict[str, Any] | None:
    """Return the map, None if there is none."""
    path = resources.files("tacdata.discrepancy.verdict").joinpath(FILE)
    return json.loads(path.read_text()) if path.is_file() else None


def fit(rows: list[dict[str, float]], right: list[bool], weight: float = 1.0) -> dict[str, Any]:
    """Return a map fitted to names whose truth is known.

    A logistic regression with a ridge of ``weight`` on every weight. Its probabilities stay between 1 / (n + 2) and
    1 - 1 / (n + 2), as n names prove no more (rule of succession).

    Args:
        rows: Features of each name.
        right: Whether it was right.
        weight: Of the ridge [1].
    """
    from scipy.optimize import minimize

    names = sorted(rows[0])
    table = np.array([[row[name] for name in names] for row in rows])
    truth = np.array(right, dtype=float)

    def loss(values: np.ndarray) -> float:
        score = values[0] + table @ values[1:]
        return float(np.sum(np.logaddexp(0, score) - truth * score) + 0.5 * weight * np.sum(values[1:] ** 2))

    best = minimize(loss, np.zeros(len(names) + 1), method="BFGS").x
    n = len(rows)
    return {
        "version": "1.0",
        "intercept": float(best[0]),
        "weights": dict(zip(names, map(float, best[1:]), strict=True)),
        "range": [1 / (n + 2), 1 - 1 / (n + 2)],
        "names": n,
        "right": int(truth.sum()),
    }
