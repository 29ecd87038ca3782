"""Clocks of foreign files as nanoseconds."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.columns import single
from tacdata.importing.formats.source_format import SourceTable
from tacdata.importing.units import FACTORS, plain, split_unit

YEAR_2000, YEAR_2100 = 946_684_800.0, 4_102_444_800.0
"""Unix times between which a clock without a stated zero is taken for Unix time [s]."""


def times(table: SourceTable, clock: dict[str, Any], where: str) -> tuple[np.ndarray, str]:
    """Return each row's time and the zero of the clock.

    Args:
        table: The file.
        clock: ``time`` of the mapping.
        where: Names the place in the mapping in errors.

    Returns:
        Times [ns], shape (rows,), int64, with the smallest int64 where a row has none; and "unix", "shared" or "own".

    Raises:
        FormatError: If the column or unit is wrong, or a Unix clock shows no Unix times.
    """
    if "column" not in clock:
        if "rate" not in clock:
            raise FormatError(f"{where}: neither column nor rate", "one of them", "say where the times are")
        return _shifted(np.arange(table.rows) / clock["rate"], clock), clock.get("zero", "own")
    name = single(table, clock["column"], f"{where}: column")
    unit = clock.get("unit") or plain(table.units.get(name) or split_unit(name)[1])
    values = table.columns[name]
    if values.dtype == object and (clocked := _times_of_day(values)) is not None:
        return _shifted(clocked, clock), clock.get("zero", "shared")
    if values.dtype == object or unit == "datetime":
        return _shifted_ns(_datetimes(values, f"{where}: {name}"), clock), "unix"
    if unit not in FACTORS["s"]:
        unit = _guessed(values)
    zero = clock.get("zero")
    scale = FACTORS["s"][unit]
    middle = float(np.nanmedian(values.astype(float))) * scale if len(values) else 0.0
    looks_unix = YEAR_2000 < middle < YEAR_2100
    if zero == "unix" and not looks_unix:
        raise FormatError(
            f"{where}: {name} shows {middle:.6g} s in {unit}, no Unix time of this century",
            "seconds since 1970 in the unit that is given", "correct unit, or give zero: shared or zero: own",
        )  # fmt: skip
    if values.dtype.kind in "iu" and "drift" not in clock and scale < 1:
        nanoseconds = values.astype(np.int64) * round(scale * 1e9)
        return nanoseconds + round(clock.get("offset", 0.0) * 1e9), zero or ("unix" if looks_unix else "shared")
    return _shifted(values.astype(float) * scale, clock), zero or ("unix" if looks_unix else "shared")


NEVER = np.iinfo(np.int64).min
"""Time of a row that has none [ns]."""


def _shifted(seconds: np.ndarray, clock: dict[str, Any]) -> np.ndarray:
    known = np.isfinite(seconds)
    whole = np.floor(np.where(known, seconds, 0.0))
    part = np.where(known, seconds, 0.0) - whole
    # Whole seconds and the rest apart: a float64 resolves Unix nanoseconds to 240 ns only.
    result = whole.astype(np.int64) * 1_000_000_000 + np.rint(part * 1e9).astype(np.int64)
    result[~known] = NEVER
    return _shifted_ns(result, clock)


def _shifted_ns(time_ns: np.ndarray, clock: dict[str, Any]) -> np.ndarray:
    known = time_ns != NEVER
    result = time_ns.copy()
    if drift := clock.get("drift", 0.0):
        first = time_ns[known].min() if known.any() else 0
        stretched = (time_ns[known] - first) / (1 + drift * 1e-6)
        result[known] = first + np.rint(stretched).astype(np.int64)
    result[known] += round(clock.get("offset", 0.0) * 1e9)
    return result


def _guessed(values: np.ndarray) -> str:
    """Return the unit that makes the values Unix times of this century, or s."""
    middle = float(np.nanmedian(values.astype(float))) if len(values) else 0.0
    return next((u for u in ("ns", "us", "ms") if YEAR_2000 < middle * FACTORS["s"][u] < YEAR_2100), "s")


def _times_of_day(values: np.ndarray) -> np.ndarray | None:
    """Return seconds since the first midnight [s], shape (n,), of texts like 12:34:56.789; None for other texts."""
    known = [text for text in values.tolist() if text is not None]
    if not known or not all(re.fullmatch(r"\d{1,2}:\d{2}:\d{2}([.,]\d+)?", str(text).strip()) for text in known):
        return None
    seconds = np.full(len(values), np.nan)
    for row, text in enumerate(values.tolist()):
        if text is not None:
            hours, minutes, rest = str(text).strip().replace(",", ".").split(":")
            seconds[row] = 3600 * int(hours) + 60 * int(minutes) + float(rest)
    back = np.diff(seconds, prepend=seconds[0]) < -43_200
    return seconds + 86_400 * np.cumsum(back)


def _datetimes(values: np.ndarray, where: str) -> np.ndarray:
    if values.dtype != object:
        return values.astype(np.int64)
    result = np.full(len(values), NEVER, dtype=np.int64)
    for row, text in enumerate(values.tolist()):
        if text is None:
            continue
        try:
            moment = datetime.fromisoformat(str(text).strip().replace(",", "."))
        except ValueError:
            raise FormatError(
                f"{where}, row {row + 1}: {text!r} is no time",
                "ISO 8601, for example 2026-01-31 12:00:00.250", "convert the column, or give a rate instead",
            ) from None  # fmt: skip
        moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
        since = moment - datetime(1970, 1, 1, tzinfo=UTC)
        result[row] = (since.days * 86_400 + since.seconds) * 1_000_000_000 + since.microseconds * 1000
    return result
