"""Numbers that a table holds as texts: with a decimal comma, signs between thousands, or a unit in each cell."""

import re
from collections.abc import Sequence

import numpy as np

from tacdata.importing.text.layout import MISSING, THOUSANDS
from tacdata.importing.units import factor, plain, quantity_of

FEWEST = 20
"""Fewest different texts of measured numbers; fewer may be names of trials."""
WRITTEN = re.compile(r"([-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s.,+-].{0,9})?")
"""A number, with a unit behind it or without."""
GROUPED = re.compile(r"[-+]?\d{1,3}([.,'\u2019 \u00a0\u202f])\d{3}(?:\1\d{3})*(?:([.,])\d+)?")
"""A number with a sign between its thousands; with its decimal sign, if it has one."""
SIGN = re.compile(r"[-+]?\d*([.,])?\d*(?:[eE][-+]?\d+)?")
PADDED = re.compile(r"0\d+")
"""A number that is rather a name."""


def written_numbers(columns: dict[str, np.ndarray]) -> dict[str, tuple[np.ndarray, str]]:
    """Return the columns of text that are numbers, and the unit of their cells; "" without one.

    Columns with a text that is no number are not among them, nor are those of few different texts.
    """
    found = {}
    for name, values in columns.items():
        if values.dtype == object and values.ndim == 1:
            texts = ["" if value is None else str(value).strip() for value in values.tolist()]
            if read := _read(["" if text in MISSING else text for text in texts]):
                found[name] = read
    return found


def ungrouped(texts: Sequence[str]) -> list[str] | None:
    """Return numbers without the signs between their thousands; None where such a sign may be a decimal one.

    It is none if a cell has two of it, or another sign before its decimal places, or if it is no point and no comma.
    """
    between, before, is_clear = set(), set(), False
    for text in filter(None, texts):
        if grouped := GROUPED.fullmatch(text):
            between.add(grouped[1])
            before.add(grouped[2])
            is_clear |= grouped[1] not in ".," or bool(grouped[2]) or text.count(grouped[1]) > 1
        elif number := SIGN.fullmatch(text):
            before.add(number[1])
        else:
            return None
    before.discard(None)
    if not is_clear or len(between) != 1 or len(before) > 1 or between & before:
        return None
    sign = between.pop()
    return [text.replace(sign, "").replace(",", ".") for text in texts]


def _read(texts: list[str]) -> tuple[np.ndarray, str] | None:
    """Return texts as numbers, shape (rows,), and their unit; None if they are not all numbers of one quantity."""
    texts = ungrouped(texts) or texts
    matches = {text: WRITTEN.fullmatch(text) for text in dict.fromkeys(texts) if text}
    if len(matches) < FEWEST or not all(matches.values()):
        return None
    parts = {text: (match[1], (match[2] or "").strip()) for text, match in matches.items() if match}
    written = [number for number, _ in parts.values()]
    commas = any("," in number for number in written)
    if any(PADDED.fullmatch(number) for number in written) or (commas and any("." in number for number in written)):
        return None
    if commas and all(THOUSANDS.fullmatch(number) for number in written if "," in number):
        return None  # "1,200" may be 1.2 or 1200
    names = {plain(unit) for _, unit in parts.values()}
    ours = {quantity_of(unit) for unit in names}
    if len(names) > 1 and (len(ours) > 1 or None in ours):
        return None
    unit = next(iter(names)) if len(names) == 1 else str(next(iter(ours)))
    scale = {name: factor(name, unit, "") if len(names) > 1 else 1.0 for name in names}
    numbers = {text: float(number.replace(",", ".")) * scale[plain(each)] for text, (number, each) in parts.items()}
    return np.array([numbers.get(text, np.nan) for text in texts]), unit
