"""A number as people read it."""

from __future__ import annotations

FULL = 1e6
"""From here on a power of ten is shorter to read [1]."""


def plain_number(value: float, digits: int) -> str:
    """Return a number with so many significant digits; below a million without a power of ten.

    Example:
        >>> from tacdata.discrepancy.plain_number import plain_number
        >>> plain_number(18_960.0, 2), plain_number(0.0123, 2), plain_number(2.4e9, 2)
        ('19000', '0.012', '2.4e+09')
    """
    short = f"{value:.{digits}g}"
    return f"{float(short):.0f}" if 10**digits <= abs(float(short)) < FULL else short
