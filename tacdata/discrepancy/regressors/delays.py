"""Initial delays and filters for the search: to first order a long one resembles other effects more than itself."""

from __future__ import annotations

import numpy as np

from tacdata.discrepancy.data.clocks import edges, shift
from tacdata.discrepancy.model.setting import Setting
from tacdata.effects import AtRest, Effect, Placed

LEAST = 0.08
"""A shorter delay is found to first order [s]."""
LEAVES = 0.7
"""A delay is tried if it leaves this share of the readings' variance about a function of depth, or less [1]..."""
EARLY_LEAVES = 0.3
"""...and readings that are early, if they leave this share: a skin that relaxes seems early, too [1]."""


def delays(setting: Setting) -> list[Placed]:
    """Return the library's delays and filters, as long as readings follow the path later; none where they do not."""
    lag, share, none = shift(setting.course)
    if abs(lag) < LEAST or share > (LEAVES if lag > 0 else EARLY_LEAVES) * none:
        return []
    onset, recovery = edges(setting.course, lag)
    plain = [e for e in setting.effects if not e.shapes and (type(e).delay is not Effect.delay or _filters(e))]
    result = []
    for e in (e for e in plain if not e.unjudgeable(setting.course, setting.response)):
        amplitudes = e.amplitudes
        times = (onset, recovery) if len(amplitudes) == 2 else [0.5 * (onset + recovery)] * len(amplitudes)
        values = {p.name: np.array(float(np.clip(t, p.low, p.high))) for p, t in zip(amplitudes, times, strict=True)}
        result.append(Placed(e, values))
    return result


def _filters(effect: Effect) -> bool:
    """Return whether it is late by its time constants: so is a ramp behind a first-order filter."""
    return effect.at_rest is AtRest.CATCHES_UP and all(p.unit == "s" for p in effect.parameters)
