"""One alarm: something is there that has no name."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Alarm:
    """Pattern seen without any form."""

    seen: str
    """Pattern, place, and size in readings or mm."""
    next: str
    """Part to inspect, or presses to record."""
