"""The regression problem: columns of all candidates and nuisances, reduced to one Gram matrix per episode."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tacdata.chain import predict
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.gram import EpisodeGrams
from tacdata.discrepancy.noise.null_model import NullModel
from tacdata.discrepancy.regressors.candidates import Candidate, CandidateColumns, Form, build
from tacdata.discrepancy.regressors.model_error import model_errors
from tacdata.discrepancy.regressors.stack import apart, side_by_side
from tacdata.discrepancy.regressors.tangent import Tangent, tangents
from tacdata.effects import Placed


@dataclass(frozen=True)
class Problem:
    """A model with its placed effects, and the Gram matrices of all columns that may be added to it."""

    setting: Setting
    null: NullModel
    placed: tuple[Placed, ...]
    board: CandidateColumns
    grams: EpisodeGrams
    tangent: Tangent
    """Derivatives of the predictions with respect to the parameters of the placed effects."""
    model_errors: np.ndarray
    """Columns of the model error of the placed effects, from 0, shape (k,), int64."""
    nuisances: np.ndarray
    """Columns of nuisances, from 0, shape (k,), int64."""
    generic: np.ndarray
    """Columns of smooth histories of the path, of no particular effect, from 0, shape (k,), int64."""
    rise: float
    """Rise of all readings under presses, root of the sum of squares in noise scales [1]."""
    parts: np.ndarray
    """Column of each placed effect's contribution in the presence of the others, from 0, shape (placed,), int64."""
    of_errors: np.ndarray
    """Number of the placed effect that each column of model error belongs to, shape (k,), int64."""
    numerics: int | None = None
    """Column of the interpolation error of the response, from 0; None if it has no numerics."""

    @property
    def candidates(self) -> list[Candidate]:
        """All effects and shapes that may be missing."""
        return self.board.candidates

    @property
    def ridge(self) -> np.ndarray:
        """Weight of the prior of each nuisance, shape (k,)."""
        return self.null.ridge

    @property
    def fixed(self) -> np.ndarray:
        """Columns fitted together with every candidate: nuisances, tangent space and model error of placed effects."""
        return np.concatenate([self.nuisances, self.tangent.columns, self.model_errors]).astype(int)

    def fixed_ridge(self, moving: float) -> np.ndarray:
        """Return the weights of the priors of `fixed`; ``moving``: weight for the placed effects [1]."""
        return np.concatenate([self.ridge, np.full(len(self.tangent.columns), moving), np.ones(len(self.model_errors))])

    @property
    def folds(self) -> np.ndarray:
        """Fold of each episode, shape (episodes,)."""
        return self.null.folds

    def without(self, at: int) -> Problem:
        """Return the problem without one placed effect, to first order: the candidates' columns stay the same."""
        # Column 0 is the residual: the effect's contribution goes back into it.
        gram, column = self.grams.gram.copy(), int(self.parts[at]) + 1
        gram[:, 0] += gram[:, column]
        gram[:, :, 0] += gram[:, :, column]
        columns = [k for k, knob in enumerate(self.tangent.knobs) if knob.at != at]
        knobs = [self.tangent.knobs[k] for k in columns]
        remaining = self.of_errors != at
        return replace(
            self,
            placed=tuple(p for k, p in enumerate(self.placed) if k != at),
            grams=EpisodeGrams(gram, self.grams.rows),
            tangent=Tangent(
                [replace(knob, at=knob.at - (knob.at > at)) for knob in knobs],
                self.tangent.values[:, :, columns],
                self.tangent.columns[columns],
            ),
            model_errors=self.model_errors[remaining],
            of_errors=self.of_errors[remaining] - (self.of_errors[remaining] > at),
            parts=np.delete(self.parts, at),
        )


def prepare(
    setting: Setting,
    null: NullModel,
    placed: Sequence[Placed] = (),
    tested: bool = True,
    among: Collection[Form] | None = None,
) -> Problem:
    """Compute all columns for a model with placed effects, and reduce them to Gram matrices.

    Args:
        setting: Input of the judgement.
        null: Nuisances and noise of the setting.
        placed: Effects in the model.
        tested: Whether score tests will follow. Only these need the generic columns and the interpolation error.
        among: Effects and shapes to be tried; None tries all.
    """
    course, response = setting.course, setting.response
    board = build(course, response, [*setting.given, *placed], setting.effects, setting.absorbed, among)
    moving = tangents(course, response, placed, setting.given)
    errors = model_errors(course, response, placed, setting.given)
    count = len(board.columns) - 1
    numerics = _numerics(setting, placed) if tested else None
    cleaned = null.beside if tested else null.nuisances
    slack = count + moving.values.shape[2]
    part_start = slack + errors.values.shape[2]
    last = part_start + len(placed)
    first = last + (numerics is not None)
    more = [moving.values, errors.values, errors.parts, *([] if numerics is None else [numerics])]
    values = side_by_side([*board.columns, *(column for each in more for column in apart(each))])
    grams = null.whitener_for(setting, [*setting.given, *placed]).episode_grams(values, cleaned)
    second = first + len(null.ridge)
    nuisances, rich = np.arange(first, second), np.arange(second, first + cleaned.shape[2])
    board = replace(board, columns=board.columns[:1])
    return Problem(
        setting,
        null,
        tuple(placed),
        board,
        grams,
        moving.at(count),
        np.arange(slack, part_start),
        nuisances,
        rich,
        _rise(setting, null),
        np.arange(part_start, last),
        errors.at,
        None if numerics is None else last,
    )


def _numerics(setting: Setting, placed: Sequence[Placed]) -> np.ndarray | None:
    """Return the interpolation error of a response, shape (m, streams, 1); None if it has no numerics."""
    coarse = setting.response.rougher()
    if coarse is None:
        return None
    streams, effects = Streams.of(setting.course), [*setting.given, *placed]
    fine_signal, coarse_signal = (
        streams.predicted(predict(setting.course, r, effects)) for r in (setting.response, coarse)
    )
    return (fine_signal - coarse_signal)[:, :, None].astype(np.float32)


def _rise(setting: Setting, null: NullModel) -> float:
    course = setting.course
    rise = Streams.of(course).rise(predict(course, setting.response, list(setting.given)), setting.response)
    return float(np.sqrt(np.sum(np.square((rise / null.noise.scale)[:, : course.channels]))))
