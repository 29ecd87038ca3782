"""Units of foreign files and their conversion to mm, N, s. Taxel readings keep their unit."""

from __future__ import annotations

import re
import unicodedata

from tacdata.errors import FormatError

GRAVITY = 9.80665
"""Standard gravity [m/s^2]: a load cell in grams was calibrated with weights (CGPM 1901)."""
FACTORS: dict[str, dict[str, float]] = {
    "mm": {
        "m": 1e3, "dm": 100.0, "cm": 10.0, "mm": 1.0, "um": 1e-3, "micron": 1e-3, "microns": 1e-3, "nm": 1e-6,
        "in": 25.4, "inch": 25.4, "mil": 0.0254,
    },
    "N": {
        "N": 1.0, "mN": 1e-3, "uN": 1e-6, "kN": 1e3, "g": GRAVITY * 1e-3, "gf": GRAVITY * 1e-3, "kg": GRAVITY,
        "kgf": GRAVITY, "lbf": 4.4482216152605, "lb": 4.4482216152605, "cN": 1e-2,
    },
    "s": {
        "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86_400.0,
        "sec": 1.0, "secs": 1.0, "second": 1.0, "msec": 1e-3, "msecs": 1e-3, "millis": 1e-3, "millisecond": 1e-3,
        "milliseconds": 1e-3, "usec": 1e-6, "usecs": 1e-6, "micros": 1e-6, "microsecond": 1e-6, "microseconds": 1e-6,
        "nsec": 1e-9, "nsecs": 1e-9, "nanos": 1e-9, "nanosecond": 1e-9, "nanoseconds": 1e-9,
        "mins": 60.0, "minute": 60.0, "minutes": 60.0, "hr": 3600.0, "hrs": 3600.0, "hour": 3600.0, "hours": 3600.0,
        "day": 86_400.0, "days": 86_400.0,
    },
    "mm/s": {"mm/s": 1.0, "mm/min": 1 / 60, "um/s": 1e-3, "m/s": 1e3, "cm/s": 10.0},
    "deg": {"deg": 1.0, "rad": 57.29577951308232},
}  # fmt: skip
"""Our unit -> the units that can be converted to it, and the factor."""
OTHERS = {"pf", "ff", "nf", "v", "mv", "uv", "count", "counts", "lsb", "adc", "ut", "mt", "gauss", "kpa", "pa", "mpa",
          "degc", "c", "k", "ohm", "kohm", "a", "ma", "hz", "1", "raw", "%"}  # fmt: skip
"""Units that are recognized behind a column's name but not converted."""


def composed(text: str) -> str:
    """Return a text in Unicode's composed form (NFC): some systems write an umlaut as two characters."""
    return unicodedata.normalize("NFC", text)


def plain(unit: str) -> str:
    """Return a unit's name in ASCII, as the tables have it."""
    name = unit.strip().replace("\u00b5", "u").replace("\u03bc", "u").replace("\u00b0", "deg")
    return "s" if name == "seconds" else name


def factor(unit: str, wanted: str, origin: str) -> float:
    """Return the factor from ``unit`` to ``wanted``.

    Raises:
        FormatError: If the unit is none of those that can be converted to it.
    """
    table = FACTORS[wanted]
    name = plain(unit)
    if name in table:
        return table[name]
    lowered = {key.lower(): value for key, value in table.items() if key != "mN"}
    if name.lower() in lowered and wanted != "N":
        return lowered[name.lower()]
    # A counter's step: "10 ms", "0.1 um".
    if match := re.fullmatch(r"(\d+(?:\.\d+)?(?:[eE][-+]?\d+)?)\s*[*x]?\s*([^\d\s].*)", name):
        return float(match[1]) * factor(match[2], wanted, origin)
    raise FormatError(f"{origin}: unit {unit!r}", ", ".join(table), "correct the unit in the mapping")


def quantity_of(unit: str) -> str | None:
    """Return our unit that ``unit`` converts to, or None."""
    return next((ours for ours, table in FACTORS.items() if plain(unit) in table), None)


def split_unit(name: str) -> tuple[str, str]:
    """Return a column's name without its unit, and the unit, as in "Fz [N]", "Fz (N)", "Fz / N" or "fz_N"."""
    if match := re.fullmatch(r"(.*?)\s*(?:\[([^\]]*)\]|\(([^)]*)\))\s*", name):
        return match[1].strip(), (match[2] or match[3] or "").strip()
    match = re.fullmatch(r"(.+?)\s*[/_ ]\s*([A-Za-z\u00b5\u03bc%]+)", name)
    # Without brackets a lone "d" is a name (depth, distance), no unit of days.
    if not match or match[2] == "d":
        return name, ""
    known = quantity_of(match[2]) or plain(match[2]).lower() in OTHERS - {"c", "k", "a", "v", "1"}
    return (match[1].strip(), match[2]) if known else (name, "")
