"""A set of effects at its optimum on the chain, with the Gram matrices that its evidence is read from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tacdata.chain import Response, predict
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.evidence.form_errors import form_errors
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import NullModel
from tacdata.discrepancy.regressors.stack import apart, side_by_side
from tacdata.discrepancy.regressors.tangent import Knob, tangents
from tacdata.discrepancy.search.gauss_newton import refine
from tacdata.discrepancy.search.problem import _numerics
from tacdata.effects import Placed


@dataclass(frozen=True)
class Optimum:
    """A set of effects with its numbers at the optimum."""

    placed: tuple[Placed, ...]
    response: Response
    knobs: tuple[Knob, ...]
    """Its numbers."""
    rooms: np.ndarray
    """How far each may move down and up [steps], shape (knobs, 2)."""
    gram: np.ndarray
    """Of each press: residual, knobs, form errors, numerics, nuisances, remainder [1], shape (presses, p, p)."""
    counts: tuple[int, int, int, int, int]
    """Columns of each kind, the residual left out."""
    ridge: np.ndarray
    """Precisions of the nuisances' priors [1], shape (nuisances,)."""
    freedom: float
    """Degrees of freedom that its response takes up [1]."""
    energy: np.ndarray
    """Half the whitened sum of squares of each press, nuisances fitted [1], shape (presses,)."""
    unconverged: float = 0.0
    """What a fitted response should have taken up and did not: half a sum of squares [1]."""

    @property
    def called(self) -> tuple[str, ...]:
        """Its mechanisms, by name."""
        return tuple(sorted(p.effect.called for p in self.placed))

    @property
    def name(self) -> tuple[str, ...]:
        """Its effects, by name."""
        return tuple(sorted(p.effect.name for p in self.placed))


def optimum(setting: Setting, placed: Sequence[Placed], null: NullModel, steps: int = 5) -> Optimum:
    """Refine a set's numbers on the chain, and reduce its columns there.

    Args:
        setting: What is judged.
        placed: Effects with first values of their numbers.
        null: Noise and nuisances.
        steps: Most Gauss-Newton steps.
    """
    model = refine(setting, placed, null, steps)
    course, response, now = setting.course, model.response, list(model.placed)
    streams, every = Streams.of(course), [*setting.given, *now]
    residual = streams.measured(course) - streams.predicted(predict(course, response, every))
    moving = tangents(course, response, now, setting.given)
    forms = form_errors(course, response, now, setting.given)
    there = replace(setting, response=response)
    numerics = _numerics(there, now)
    parts = [moving.values, forms, *([] if numerics is None else [numerics])]
    values = side_by_side([residual, *(c for part in parts for c in apart(part))])
    # One projection for all sets and columns: evidences of sets in other spaces are not comparable.
    grams = null.whitener.episode_grams(values, null.beside, null.beside_grams)
    nuisances = len(null.ridge)
    counts = (len(moving.knobs), forms.shape[2], int(numerics is not None), nuisances, null.beside.shape[2] - nuisances)
    rooms = np.array([k.room(now) for k in moving.knobs]).reshape(-1, 2)
    return Optimum(
        tuple(now), response, tuple(moving.knobs), rooms, grams.gram, counts, null.ridge, model.freedom, model.energy
    )
