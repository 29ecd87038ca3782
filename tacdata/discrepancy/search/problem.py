"""The regression problem: columns of everything that may be missing, reduced to a Gram matrix an episode."""

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
    """One state of the model with all candidates."""

    setting: Setting
    null: NullModel
    placed: tuple[Placed, ...]
    board: CandidateColumns
    grams: EpisodeGrams
    tangent: Tangent
    """Columns by which the placed effects may still move."""
    model_errors: np.ndarray
    """Columns of the model error of the placed effects, from 0, shape (k,), int64."""
    nuisances: np.ndarray
    """Columns of nuisances, from 0, shape (k,), int64."""
    generic: np.ndarray
    """Columns that belong to no effect, from 0, shape (k,), int64."""
    rise: float
    """Rise of all readings under presses, root of the sum of squares in noise scales [1]."""
    parts: np.ndarray
    """Columns of each placed effect's contribution to the others, from 0, shape (placed,), int64."""
    of_errors: np.ndarray
    """Which placed effect each of the model errors is of, shape (k,), int64."""
    numerics: int | None = None
    """Column of the response's own error, from 0; None if it has no numerics."""

    @property
    def candidates(self) -> list[Candidate]:
        """Everything that may be missing."""
        return self.board.candidates

    @property
    def ridge(self) -> np.ndarray:
        """Weight of each nuisance's prior, shape (k,)."""
        return self.null.ridge

    @property
    def fixed(self) -> np.ndarray:
        """Columns fitted with every candidate: nuisances, placed effects, their model error."""
        return np.concatenate([self.nuisances, self.tangent.columns, self.model_errors]).astype(int)

    def fixed_ridge(self, moving: float) -> np.ndarray:
        """Return the weights of their priors; ``moving``: of the placed effects [1]."""
        return np.concatenate([self.ridge, np.full(len(self.tangent.columns), moving), np.ones(len(self.model_errors))])

    @property
    def folds(self) -> np.ndarray:
        """Fold of each episode, shape (episodes,)."""
        return self.null.folds

    def without(self, at: int) -> Problem:
        """Return the same without one placed effect, to first order: candidates keep their columns."""
        gram, own = self.grams.gram.copy(), int(self.parts[at]) + 1
        gram[:, 0] += gram[:, own]
        gram[:, :, 0] += gram[:, :, own]
        kept = [k for k, knob in enumerate(self.tangent.knobs) if knob.at != at]
        knobs = [self.tangent.knobs[k] for k in kept]
        others = self.of_errors != at
        return replace(
            self,
            placed=tuple(p for k, p in enumerate(self.placed) if k != at),
            grams=EpisodeGrams(gram, self.grams.rows),
            tangent=Tangent(
                [replace(knob, at=knob.at - (knob.at > at)) for knob in knobs],
                self.tangent.values[:, :, kept],
                self.tangent.columns[kept],
            ),
            model_errors=self.model_errors[others],
            of_errors=self.of_errors[others] - (self.of_errors[others] > at),
            parts=np.delete(self.parts, at),
        )


def prepare(
    setting: Setting,
    null: NullModel,
    placed: Sequence[Placed] = (),
    tested: bool = True,
    among: Collection[Form] | None = None,
) -> Problem:
    """Build columns given the placed effects and reduce them.

    Args:
        setting: Input of the judgement.
        null: Its nuisances and noise.
        placed: Effects that the model has.
        tested: Whether it will be tested: columns of no effect and the response's own error are for tests alone.
        among: Effects and shapes that are tried; all, unless given.
    """
    course, response = setting.course, setting.response
    board = build(course, response, [*setting.given, *placed], setting.effects, setting.absorbed, among)
    moving = tangents(course, response, placed, setting.given)
    errors = model_errors(course, response, placed, setting.given)
    count = len(board.columns) - 1
    numerics = _numerics(setting, placed) if tested else None
    beside = null.beside if tested else null.nuisances
    slack = count + moving.values.shape[2]
    said = slack + errors.values.shape[2]
    last = said + len(placed)
    first = last + (numerics is not None)
    more = [moving.values, errors.values, errors.parts, *([] if numerics is None else [numerics])]
    values = side_by_side([*board.columns, *(column for each in more for column in apart(each))])
    found = null.whitener_for(setting, [*setting.given, *placed]).episode_grams(values, beside)
    second = first + len(null.ridge)
    nuisances, rich = np.arange(first, second), np.arange(second, first + beside.shape[2])
    board = replace(board, columns=board.columns[:1])
    return Problem(
        setting,
        null,
        tuple(placed),
        board,
        found,
        moving.at(count),
        np.arange(slack, said),
        nuisances,
        rich,
        _rise(setting, null),
        np.arange(said, last),
        errors.at,
        None if numerics is None else last,
    )


def _numerics(setting: Setting, placed: Sequence[Placed]) -> np.ndarray | None:
    """Return the error of a response, shape (m, streams, 1); None where it has no numerics."""
    rough = setting.response.rougher()
    if rough is None:
        return None
    streams, every = Streams.of(setting.course), [*setting.given, *placed]
    now, other = (streams.predicted(predict(setting.course, r, every)) for r in (setting.response, rough))
    return (now - other)[:, :, None].astype(np.float32)


def _rise(setting: Setting, null: NullModel) -> float:
    course = setting.course
    rise = Streams.of(course).rise(predict(course, setting.response, list(setting.given)), setting.response)
    return float(np.sqrt(np.sum(np.square((rise / null.noise.scale)[:, : course.channels]))))
