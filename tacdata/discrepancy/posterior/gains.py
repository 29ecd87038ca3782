"""Gains of channels beyond what calibration leaves open, beside the most probable set of effects."""

from __future__ import annotations

import numpy as np

from tacdata.discrepancy.evidence.optimum import Optimum
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.posterior.policy import Policy

INFORMED = 3.0
"""A channel's gain is estimated if presses have so many times its prior's information [1]."""


def channel_gains(model: Optimum, setting: Setting, presses: np.ndarray, policy: Policy) -> np.ndarray:
    """Return each channel's gain beyond the response's [1], shape (channels,).

    0 where the response is fitted; NaN for channels that these presses do not stir.

    Args:
        model: The most probable set at its optimum.
        setting: With calibration's nuisance, whose columns are the first of all nuisances.
        presses: Those that are used, int64.
        policy: With the prior of the response's own error.
    """
    channels, effect = setting.course.channels, setting.channel_gain
    if effect is None:
        return np.zeros(channels)
    knobs, forms, numerics, nuisances, _ = model.counts
    first, last = 1 + knobs + forms + numerics, 1 + knobs + forms + numerics + nuisances
    gram = model.gram[presses].sum(axis=0)
    index = np.arange(1, last)
    precision = np.concatenate(
        [
            np.full(knobs, 1e-6),
            np.full(forms, 1 / policy.forms**2),
            np.full(numerics, 1 / policy.numerics**2),
            model.ridge,
        ]
    )
    values = np.linalg.solve(gram[np.ix_(index, index)] + np.diag(precision + 1e-12), gram[index, 0])
    own = values[first - 1 : first - 1 + channels] * effect.amplitudes[0].typical
    information = np.diag(gram)[first : first + channels]
    return np.where(information > INFORMED * model.ridge[:channels], own, np.nan)


def gains_of_halves(model: Optimum, setting: Setting, policy: Policy) -> np.ndarray:
    """Return the channels' gains in the first and the second half of the session [1], shape (2, channels)."""
    halves = np.array_split(np.arange(len(model.gram)), 2)
    return np.stack([channel_gains(model, setting, half, policy) for half in halves])
