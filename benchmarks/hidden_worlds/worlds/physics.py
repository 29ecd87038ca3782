"""Everything that may be hidden, by name."""

from worlds import forms, guide, material, mounting, outside, readout, simulator, taxel, timing
from worlds.hidden import KNOWN, STAGES

SOURCES = (guide, mounting, material, taxel, readout, timing, simulator, forms, outside)
"""Where they are written; importing them enters them."""

FORMS = tuple(name for name, h in KNOWN.items() if h.act.__module__ == forms.__name__)
OUTSIDE = tuple(name for name, h in KNOWN.items() if h.act.__module__ == outside.__name__)
BUGS = tuple(name for name, h in KNOWN.items() if h.act.__module__ == simulator.__name__)
SINGLES = tuple(name for name in KNOWN if name not in (*FORMS, *OUTSIDE, *BUGS))
AMPLITUDES = {"gain": "modulus", "modulus": "gain"}
"""Pairs that only the taxel's curve distinguishes, which no lab knows so well: aliases without a force reading."""

__all__ = ["AMPLITUDES", "BUGS", "FORMS", "KNOWN", "OUTSIDE", "SINGLES", "SOURCES", "STAGES"]
