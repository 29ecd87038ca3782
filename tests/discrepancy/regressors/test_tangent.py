"""Derivatives by every number of placed effects, moved one by one or together."""

import numpy as np
from pressing import course

from tacdata.chain import predict
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.regressors.tangent import STEP, tangents
from tacdata.effects import Placed, load


def placed(name, channels, **shapes):
    effect = load(name)
    values = {p.name: shapes.get(p.name, p.default + 0.3 * p.typical) for p in effect.parameters}
    per = {p.name for p in effect.parameters if p.per_channel}
    return Placed(effect, {n: np.full(channels, v) if n in per else np.array(v) for n, v in values.items()})


def one_by_one(pressed, response, effects):
    """Return the same derivatives, each from a run of its own."""
    streams, made = Streams.of(pressed), tangents(pressed, response, effects)
    now = streams.predicted(predict(pressed, response, effects))
    columns = []
    for knob in made.knobs:
        step = STEP if knob.room(effects)[1] > STEP else -STEP
        there = streams.predicted(predict(pressed, response, knob.moved(effects, step)))
        columns.append((there - now) / step)
    return made, np.stack(columns, axis=-1)


def test_a_number_of_every_channels_own_is_moved_for_all_at_once():
    pressed = course(episodes=6)
    response = FittedResponse(pressed)
    effects = [placed("drift", 3), placed("relaxation", 3, tau=1.0), placed("latency", 3)]
    made, expected = one_by_one(pressed, response, effects)
    assert sum(k.channel is not None for k in made.knobs) == 3
    assert (np.abs(made.values - expected).max(axis=(0, 1)) < 1e-4 * np.abs(expected).max(axis=(0, 1))).all()


def test_beside_what_mixes_channels_each_is_moved_by_itself():
    pressed = course(episodes=6)
    response = FittedResponse(pressed)
    effects = [placed("drift", 3), placed("crosstalk", 3)]
    made, expected = one_by_one(pressed, response, effects)
    at = next(k for k, knob in enumerate(made.knobs) if knob.channel == 0)
    assert np.abs(made.values[:, 1, at]).max() > 1e-3 * np.abs(made.values[:, 0, at]).max(), "its neighbour moves too"
    assert (np.abs(made.values - expected).max(axis=(0, 1)) < 1e-4 * np.abs(expected).max(axis=(0, 1))).all()


def test_a_fitted_response_is_corrected_apart_from_its_copy():
    pressed = course(episodes=6)
    response = FittedResponse(pressed)
    before = response.load(pressed.tip, pressed.tool).copy()
    other = response.copied()
    more = np.full((len(pressed.read), 3), 50.0) * pressed.reduced.tip[:, 2:]
    other.correct(more, response.features(pressed.reduced))
    assert np.abs(other.load(pressed.tip, pressed.tool) - before).max() > 1.0
    np.testing.assert_array_equal(response.load(pressed.tip, pressed.tool), before)
