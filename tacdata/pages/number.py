"""Numbers in print and in data."""

import json
import math
from typing import Any

import numpy as np

DIGITS = 5
"""Significant digits of data in a page."""


def in_print(value: Any) -> str:
    """Return a value in print: a dash for None and for a number that is not finite."""
    if value is None or (isinstance(value, float | np.floating) and not math.isfinite(value)):
        return "–"
    return f"{value:.4g}" if isinstance(value, float | np.floating) else str(value)


def as_json(document: Any) -> str:
    """Return JSON that may be put into a page: no number that JSON lacks, no sign that ends a script."""
    return json.dumps(_plain(document), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float | np.floating):
        return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
    return value.item() if isinstance(value, np.generic) else value
