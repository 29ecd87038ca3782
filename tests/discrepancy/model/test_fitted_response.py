"""A response fitted to recordings: what it says in the air is an offset, and no history."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course
from scipy.interpolate import BSpline

from tacdata.chain import predict
from tacdata.discrepancy.model.fitted_response import FittedResponse, _roughness
from tacdata.discrepancy.model.response_splines import taken_up
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.episode_errors import EpisodeErrors, ErrorSizes
from tacdata.discrepancy.noise.null_model import as_large, null_model
from tacdata.discrepancy.search.gauss_newton import refine
from tacdata.effects import Placed, load


def test_a_places_own_level_is_no_load():
    """Readings that are higher at one place in the air leave the load there zero, and pressed as it was."""
    plain = course(noise=0.1)
    level = np.where(plain.row_site == plain.row_site.max(), 40.0, 0.0)[:, None]
    raised = replace(plain, readings=plain.readings + level)
    air = plain.tip[:, 2] <= 0
    loads = [FittedResponse(c).load(c.tip, c.tool) for c in (plain, raised)]
    assert np.abs(loads[1][air]).max() < 0.01 * np.abs(loads[1]).max()
    # Without that the level itself would be the difference: 40.
    assert np.abs(loads[1] - loads[0]).max() < 2.0


def test_the_same_depths_asked_again_are_answered_the_same():
    made = course()
    response = FittedResponse(made)
    deeper = made.tip + np.array([0.0, 0.0, 0.05])
    first = response.load(made.tip, made.tool)
    assert not np.allclose(response.load(deeper, made.tool), first)
    np.testing.assert_array_equal(response.load(made.tip, made.tool), first)


def test_slopes_are_told_through_the_noise():
    """What moves the tip shows by slopes: those of splines that follow the noise are mostly noise in the air."""
    pressed, free = [], []
    for seed in range(3):
        made = course(noise=4.0, seed=seed)
        response, step = FittedResponse(made), np.array([0.0, 0.0, 0.005])
        slope = (response.load(made.tip + step, made.tool) - response.load(made.tip - step, made.tool)) / 0.01
        weights = np.array([[1.0, 0.5, 0.2], [0.2, 0.6, 1.0]])[made.row_site]
        true = 800 * 1.5 * weights * np.sqrt(np.maximum(made.tip[:, 2:], 0.0))
        air = made.tip[:, 2] < -0.05
        pressed.append(np.sqrt(np.mean(np.square(slope - true)[~air]) / np.mean(np.square(true)[~air])))
        free.append(np.sqrt(np.mean(np.square(slope)[air])) / np.abs(true).max())
    assert np.mean(pressed) < 0.13
    assert np.mean(free) < 0.02


def test_slopes_hold_where_all_presses_end():
    """Most rows stand at the deepest depth. End knots taken for evenly spaced make it 2.5 times as steep there."""
    made = course(noise=4.0)
    deepest = made.tip[:, 2].max()
    tip = made.tip.copy()
    tip[:, 2] = np.minimum(tip[:, 2], 0.6 * deepest)
    weights = np.array([[1.0, 0.5, 0.2], [0.2, 0.6, 1.0]])[made.row_site]
    rise = 800 * weights * np.maximum(tip[:, 2:], 0.0) ** 1.5
    gain = 1 + 0.01 * np.random.default_rng(3).normal(size=(made.episodes, 3))[made.episode]
    noise = np.random.default_rng(4).normal(0.0, 4.0, made.readings.shape)
    made = replace(made, tip=tip, readings=100.0 + gain * rise + noise)
    response, step = FittedResponse(made), np.array([0.0, 0.0, 0.005])
    slope = (response.load(made.tip + step, made.tool) - response.load(made.tip - step, made.tool)) / 0.01
    at = tip[:, 2] > 0.999 * tip[:, 2].max()
    true = 800 * 1.5 * weights * np.sqrt(np.maximum(tip[:, 2:], 0.0))
    assert np.sqrt(np.mean(np.square(slope - true)[at]) / np.mean(np.square(true)[at])) < 0.2


def test_a_straight_line_bends_nowhere():
    """However knots lie: a penalty on it would pull its slope to another one."""
    inner = np.array([0.0, 0.02, 0.05, 0.2, 0.6, 0.7, 1.0])
    basis = BSpline(np.concatenate([[0.0] * 3, inner, [1.0] * 3]), np.zeros(len(inner) + 2), 3)
    at = np.linspace(0.0, 1.0, 200)
    design = BSpline.design_matrix(at, basis.t, 3).toarray()
    rough = _roughness(basis)
    bending = []
    for power in (1.0, 2.0):
        weights = np.linalg.lstsq(design, at**power, rcond=None)[0]
        bending.append(float(weights @ rough @ weights))
    assert bending[0] < 1e-12 * bending[1]


def test_how_a_skin_is_first_touched_is_followed():
    """Half of what splines miss there looks like a skin that sticks: knots lie close where little is read yet."""
    missed = []
    for seed in range(3):
        made, rng = course(noise=0.2, seed=seed, power=0.75, episodes=36), np.random.default_rng(seed)
        # Presses of any depth, with gains of 2 %: they bend what is fitted to all of them, where much is read.
        deeper = rng.uniform(0.5, 2.0, made.episodes)[made.episode][:, None]
        gains = (1 + 0.02 * rng.normal(size=made.episodes))[made.episode][:, None]
        tip = made.tip.copy()
        tip[:, 2:] = np.where(tip[:, 2:] > 0, deeper * tip[:, 2:], tip[:, 2:])
        varied = replace(made, tip=tip, readings=5000 + gains * deeper**1.125 * (made.readings - 5000))
        response = FittedResponse(varied)
        left = varied.reduced.readings - response.signal(response.load(tip, made.tool))[made.read]
        depth = tip[made.read, 2]
        near = [left[(depth > low) & (depth < low + 0.02)].mean() for low in np.arange(-0.06, 0.06, 0.02)]
        missed.append(np.sqrt(np.mean(np.square(near))))
    assert np.mean(missed) < 0.24, "counts; 0.30 with knots laid by curvature alone"


def placed(name, share=1.0):
    effect = load(name)
    return Placed(
        effect, {p.name: np.array(p.default + p.typical * (1 if p.grid else share)) for p in effect.parameters}
    )


@pytest.mark.parametrize("name", ["relaxation", "nonlinear_relaxation", "proportional_hysteresis", "baseline_tracking"])
def test_splines_that_go_through_an_effect_gain_no_freedom(name):
    """Levels go through nothing, and no press takes up what splines of another place have left in a memory."""
    made = course()
    # The second place is pressed twice: it has fewer splines.
    keep = np.isin(made.episode, np.flatnonzero((made.site == 0) | (np.arange(made.episodes) < 4)))
    kept = np.unique(made.episode[keep])
    part = replace(
        made,
        **{n: getattr(made, n)[keep] for n in ("time", "tip", "tool", "readings", "averaged")},
        episode=np.searchsorted(kept, made.episode[keep]),
        session=made.session[kept],
        site=made.site[kept],
        names=tuple(made.names[k] for k in kept),
    )
    response = FittedResponse(part)
    plain = response.features(part.reduced)
    through = taken_up(part, response, [placed(name)])
    empty = []
    for place in range(2):
        rows = response.context[part.read] == place
        nowhere = ~plain[rows].any(axis=0)
        empty.append(nowhere.sum())
        assert not np.abs(through[rows][:, nowhere]).max(initial=0.0) > 1e-12
    assert empty[1] > empty[0] + 5
    assert through.sum(axis=1) == pytest.approx(1.0, abs=1e-9), "together they are a level"
    assert np.abs(through - plain).max() > 1e-3


@pytest.mark.parametrize(("name", "never"), [("relaxation", 3.0), ("proportional_hysteresis", 1.8)])
def test_what_splines_take_up_counts_nowhere_once_they_have(name, never, monkeypatch):
    """A model's energy hardly depends on whether they are corrected once or twice. What they never took up counts."""
    made = course(relaxed=0.1)
    setting = Setting(made, FittedResponse(made), [])
    null, model = null_model(setting), [placed(name, 1.0)]
    bare = refine(setting, [], null, steps=0).energy.sum()
    told, correct = [], FittedResponse.correct
    for most in (2, 1, 0):
        made_so_far = iter(range(most))

        def counted(*given, left=made_so_far):
            return correct(*given) if next(left, None) is not None else None

        monkeypatch.setattr(FittedResponse, "correct", counted)
        told.append(refine(setting, model, null, steps=0).energy.sum())
    assert told[0] < 0.95 * bare
    assert told[0] == pytest.approx(told[1], abs=1e-3 * bare)
    assert told[2] > never * told[0]


@pytest.mark.parametrize("name", ["relaxation_read", "hysteresis_read"])
def test_splines_go_through_an_effect_beside_the_load_that_there_is(name):
    """Effects that are not linear in load: what a little of each spline adds is what the model says of it."""
    made = course(noise=0.1, hold=3.0)
    made = replace(made, time=made.time + 60.0 * made.episode)
    one = placed(name)
    response, effect = FittedResponse(made), [Placed(one.effect, one.values | {"m": np.array(1.6)})]
    by, channels = np.linspace(1.0, 2.0, response.width), np.array([1.0, 0.5, 0.2])
    other = response.copied()
    other._weights = [w + 1e-3 * by[: len(w), None] * channels for w in response._weights]
    other._answers = []
    change = predict(made, other, effect).signal - predict(made, response, effect).signal
    adds = (taken_up(made, response, effect) - response.air[made.read]) @ by
    pressed = made.tip[made.read, 2] > 0.3
    expected = (1e-3 * adds[:, None] * channels)[pressed]
    wrong = np.sqrt(np.mean(np.square(change[made.read][pressed] - expected)))
    assert wrong < 0.1 * np.sqrt(np.mean(np.square(expected)))


def test_the_unit_of_an_effect_is_no_freedom():
    """What drifts by a share of the largest rise does so by as much, whichever spline is a little larger."""
    made = course(noise=0.1)
    response = FittedResponse(made)
    plain = taken_up(made, response, [])
    assert taken_up(made, response, [placed("warm_up_drift")]) == pytest.approx(plain, abs=1e-9)


def test_an_effect_on_gains_is_allowed_no_other_errors_of_gain():
    """Where readings rise by half again, so would what one standard deviation of an own gain changes: it must not."""
    made = course(episodes=12)
    setting = Setting(made, FittedResponse(made), [])
    null = null_model(setting)
    gain_error, errors = null.noise.gain_error, null.errors
    assert gain_error is not None
    episode = made.reduced.episode
    bent = (1 + made.reduced.tip[:, 2] + 0.5 * (episode > 5))[:, None]
    for told in (gain_error, errors):
        now = as_large(told * (bent if told.ndim == 2 else bent[:, :, None]), told, episode)
        assert not np.allclose(now, told)
        for k in range(made.episodes):
            # A gain of each stream has its own size, an error of pose one over all of them.
            axis = 0 if told.ndim == 2 else (0, 1)
            sizes = [np.sqrt(np.square(v[episode == k], dtype=float).sum(axis=axis)) for v in (now, told)]
            assert sizes[0] == pytest.approx(sizes[1], rel=1e-4)


def test_errors_of_an_episode_hold_no_effect_of_another_model(monkeypatch):
    """Beside large errors of gain a model without relaxation must not take it for every episode's own error."""
    made = course(relaxed=0.15, hold=4.0, pulls=False)
    setting, effect = Setting(made, FittedResponse(made), []), load("relaxation_read")
    sizes = ErrorSizes(np.array([1.0, 10.0]), np.zeros(0, dtype=np.int64), np.ones(made.episodes))
    monkeypatch.setattr(EpisodeErrors, "poses", lambda *_: sizes)
    first = null_model(setting)
    start = Placed(effect, {"f": np.array(0.1), "tau": np.array(2.0), "m": np.array(1.0)})
    model = refine(setting, [start], first)
    again = null_model(replace(setting, response=model.response, given=model.placed))
    left = [refine(setting, [], null, steps=0).energy.sum() for null in (first, again)]
    assert model.energy.sum() < 0.2 * left[0]
    assert left[1] > 0.5 * left[0]


def test_without_the_shallowest_presses_the_lowest_readings_are_the_idle_ones():
    """Presses that only hold: those left have no reading at the course's lowest depth."""
    made = course(episodes=12)
    deep = made.tip[:, 2] > 0.5 * made.tip[:, 2].max()
    response = FittedResponse(replace(made, averaged=np.where(deep, made.averaged, 0.0)))
    assert np.isfinite(response.idle).all()
    assert np.isfinite(response.signal(response.load(made.tip, made.tool))).all()
