"""One alarm: something is there that has no name."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Alarm:
    """What was seen without any form."""

    seen: str
    """What, where, and how large in readings or mm."""
    next: str
    """What to look at or to record."""
