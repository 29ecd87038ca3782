"""Cycles of growing depth at one place: softening shows in the first of each depth alone."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course
from test_judge import FEW, judged

from tacdata.chain import predict
from tacdata.chain.rows import rows_of
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.effects import Placed, load

PERIOD = 4.0
"""Of a cycle [s]."""


def cycles(softened, seed=0, sets=3, count=6, touch=0.006):
    """Return sets of cycles, each deeper than the one before; the skin softens below the deepest so far.

    It does so by a tanh of how far it is below [mm]: no form of the library.
    """
    made, rng = course(episodes=sets * count), np.random.default_rng(seed)
    parts, clock, deepest = [], 0.0, 0.0
    weights = np.array([1.0, 0.6, -0.3])
    for k in range(sets * count):
        time = np.arange(0, PERIOD, 0.005)
        depth = (0.5 + 0.1 * (k % count)) * (1 - np.cos(2 * np.pi * time / PERIOD)) - 0.05
        most = np.maximum(np.maximum.accumulate(depth), deepest)
        deepest = float(most[-1])
        pressed = np.maximum(depth + touch * rng.normal(), 0.0) ** 1.4
        pressed = pressed * (1 - softened * np.tanh((most - np.maximum(depth, 0.0)) / 0.5))
        pick = np.arange(rng.integers(8), len(time), 8)
        gain = 1 + 0.008 * rng.normal()
        values = 5000 + 400 * gain * pressed[pick, None] * weights + rng.normal(size=(len(pick), 3))
        path = np.column_stack([0 * time, 0 * time, depth])
        parts.append((clock, rows_of(time[pick], values, time[::4], path[::4])))
        clock += PERIOD
    length = [len(rows.time) for _, rows in parts]
    return replace(
        made,
        time=np.concatenate([begin + rows.time for begin, rows in parts]),
        episode=np.repeat(np.arange(len(parts)), length),
        tip=np.concatenate([rows.tip for _, rows in parts]),
        tool=np.zeros(sum(length), dtype=int),
        readings=np.concatenate([rows.values for _, rows in parts]),
        averaged=np.concatenate([rows.averaged for _, rows in parts]),
        site=np.zeros(len(parts), dtype=int),
    )


@pytest.mark.parametrize(("softened", "status"), [(0.08, "named"), (0.0, "none")])
def test_softening_is_named_in_cycles_of_growing_depth(softened, status):
    answer = judged(effects=(*FEW, "softening", "softening_of_depth", "wear_in"), made=cycles(softened))
    assert answer.status == status
    assert answer.names == ({"softening"} if softened else set())


def test_without_its_form_small_softening_is_missed():
    """Why the form is there: the other one's sharpness is one for all depths."""
    assert judged(effects=(*FEW, "softening", "wear_in"), made=cycles(0.08)).status != "named"


def test_a_skin_softens_alike_below_any_depth_that_it_knows():
    """The form asks for the share of the deepest press, not for millimetres."""
    made, tip = cycles(0.0, sets=1, count=2), cycles(0.0, sets=1, count=2).tip
    response = FittedResponse(made)
    effect = Placed(load("softening_of_depth"), {"a": np.array(0.2), "b": np.array(0.8)})
    eased = []
    for scale in (0.5, 1.0):
        one = replace(made, tip=scale * tip)
        plain, soft = (predict(one, response, placed).force for placed in ([], [effect]))
        eased.append(np.divide(soft, plain, out=np.ones_like(plain), where=plain > 0))
    assert eased[0].min() < 0.9
    assert eased[0] == pytest.approx(eased[1], abs=1e-6)
