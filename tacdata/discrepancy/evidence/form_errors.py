"""Form errors: what the equations of placed effects may be off about, as columns with a prior."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata.chain import Chain, Course, Response
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.regressors.model_error import OTHER_FORMS, OTHER_SHAPES, OTHER_SIZES, modulations
from tacdata.effects import Placed

NEGLIGIBLE = 1e-9
"""A form that changes less than this share of the effect is left out [1]."""


def form_errors(
    course: Course, response: Response, placed: Sequence[Placed], given: Sequence[Placed] = ()
) -> np.ndarray:
    """Return columns at one standard deviation [each stream's unit], shape (n, streams, k), float32.

    An effect's contribution is off by a share of itself (`form_error`), with depth, rate, direction, time and its own
    size. A mechanism of a material has other times and widths beside its own.
    """
    streams, columns = Streams.of(course), []
    for at, one in enumerate(placed):
        others = [*given, *(p for k, p in enumerate(placed) if k != at)]
        chain = Chain(course, response, others)
        bare = streams.predicted(chain.prediction)
        contribution = streams.predicted(chain.again([*others, one])) - bare
        share, size = one.effect.form_error, float(np.linalg.norm(contribution))
        columns += [share * contribution * by for by in modulations(course, streams, contribution)]
        for variant in _variants(one):
            change = streams.predicted(chain.again([*others, variant])) - bare
            large = float(np.linalg.norm(change))
            if large > NEGLIGIBLE * size:
                columns.append(OTHER_FORMS * share * size / large * change)
    if not columns:
        return np.zeros((len(course.read), streams.count, 0), dtype=np.float32)
    return np.stack(columns, axis=-1).astype(np.float32)


def _variants(one: Placed) -> list[Placed]:
    """Return an effect with other shapes; one without shapes at other sizes, if it may be of several at once."""
    effect = one.effect
    if not effect.distributed:
        return []
    if not effect.shapes:
        values = [
            {
                p.name: np.clip(p.default + by * (one.values[p.name] - p.default), p.low, p.high)
                for p in effect.parameters
            }
            for by in OTHER_SIZES
        ]
        return [Placed(effect, own) for own in values]
    return [
        Placed(effect, {**one.values, p.name: np.clip(by * one.values[p.name], p.low, p.high)})
        for p in effect.shapes
        for by in OTHER_SHAPES
    ]
