"""Scores of single contacts: presses with one, and presses with several at once, by how near these are."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from scipy.stats import binomtest

from tacdata.training.metrics.contacts import (
    LEAST_PROMINENCE,
    LONG,
    PREDICTED_LEAST,
    PREDICTED_PROMINENCE,
    PROMINENCE,
    REACH,
    ROUND_PROMINENCE,
    ContactMatch,
    match,
)
from tacdata.training.metrics.depth_maps import summarize

DISTANCES = (3.0, 4.0, 5.0)
"""Borders of the distance of the two nearest contacts, between groups of presses [mm]."""


def scored(presses: Iterable[tuple[np.ndarray, np.ndarray]], pitch: float) -> dict[str, Any]:
    """Return the part "contacts" of a scores document.

    Args:
        presses: Predicted and labelled map of each press at full depth [mm], shapes (pixels_x, pixels_y).
        pitch: Distance of pixels [mm].
    """
    matches = [match(depth, label, pitch) for depth, label in presses]
    return {
        "prominence": PROMINENCE,
        "least_prominence_mm": LEAST_PROMINENCE,
        "reach_mm": REACH,
        "predicted": {
            "long": LONG,
            "prominence_long": PREDICTED_PROMINENCE,
            "prominence_round": ROUND_PROMINENCE,
            "least_prominence_mm": PREDICTED_LEAST,
        },
        "presses": contact_rows(matches, pitch),
    }


def contact_rows(matches: Sequence[ContactMatch], pitch: float) -> list[dict[str, Any]]:
    """Return a row for presses with one contact, and rows for those with several by their least distance [mm]."""
    rows = [_row([m for m in matches if len(m.labelled) == 1], "one", None, None)]
    for low, high in itertools.pairwise((0.0, *DISTANCES, np.inf)):
        group = [m for m in matches if len(m.labelled) > 1 and low <= pitch * m.apart < high]
        rows.append(_row(group, "several", low, None if high == np.inf else high))
    return [row for row in rows if row["presses"]]


def _row(matches: list[ContactMatch], contacts: str, low: float | None, high: float | None) -> dict[str, Any]:
    complete = sum(not m.missed for m in matches)
    interval = binomtest(complete, len(matches)).proportion_ci(method="wilson") if matches else (None, None)
    errors = np.concatenate([m.error for m in matches]) if matches else np.zeros(0)
    return {
        "contacts": contacts,
        "above_mm": low,
        "up_to_mm": high,
        "presses": len(matches),
        "all_found": {"count": complete, "of": len(matches), "wilson_95": list(interval)},
        "missed": sum(m.missed for m in matches),
        "invented": sum(m.invented for m in matches),
        "centroid_error": asdict(summarize(errors)),
    }
