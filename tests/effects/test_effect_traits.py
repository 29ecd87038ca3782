"""A new effect is one file: the search races, refuses and splits it as its class data say, no other file touched."""

import importlib
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_effects_conform import Springs, pressed

import tacdata.effects
from tacdata.chain import predict
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.response_splines import taken_up
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.nuisances import pose_errors
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.regressors.candidates import build
from tacdata.discrepancy.regressors.model_error import model_errors
from tacdata.discrepancy.report.calibration import calibration_error, gains_beyond_calibration
from tacdata.discrepancy.report.conclusion import Named
from tacdata.discrepancy.report.document import document
from tacdata.discrepancy.report.judgement import concluded
from tacdata.discrepancy.search.problem import prepare
from tacdata.effects import Placed, library, load
from tacdata.example.shipped import SESSION
from tacdata.recording import read_episode, read_session
from tacdata.revision.labels.confirm import touches_fem
from tacdata.revision.labels.pose_path import moved_episodes
from tacdata.revision.labels.relabel import changed_skin, moves_labels
from tacdata.sensor import default_sensor

FILE = '''
"""A file of a test."""

from dataclasses import replace

import numpy as np

from tacdata.chain.memory import low_pass
from tacdata.effects.effect import AtRest, Effect, GainKind, Growth, LikeGain, Parameter, Scale


class Newcomer(Effect):
    """Readings are smeared and grow."""

    stage = "{stage}"
    moves = ("signal",)
    group = "lag"
    equation = "s = (1 + k) L_k s_e"
    source = "a test"
    experiment = "none"
    parameters = (Parameter("k", "{unit}", "size", 0.05, 0.0, 1.0),)
    {traits}

    def apply(self, state, values):
        k = float(values["k"])
        if self.stage != "readout":
            return replace(state, pose=state.pose * (1 + k * np.array([0.0, 0.0, 1.0])))
        return replace(state, signal=low_pass(state.signal - 1000, state.course.step, max(k, 1e-9)) * (1 + k) + 1000)
'''


@pytest.fixture
def newcomer(tmp_path, monkeypatch):
    """Return what writes an effect's file with traits beside the library, and loads it."""
    monkeypatch.setattr(tacdata.effects, "__path__", [*tacdata.effects.__path__, str(tmp_path)])

    def write(*traits, stage="readout", unit="1"):
        text = FILE.replace("{traits}", "\n    ".join(traits)).replace("{stage}", stage).replace("{unit}", unit)
        (tmp_path / "newcomer.py").write_text(text)
        importlib.invalidate_caches()
        return load("newcomer")

    yield write
    sys.modules.pop("tacdata.effects.newcomer", None)


def read_with(effect, size, rates):
    """Return presses at some rates that were read with an effect in place, and their response."""
    made, response = pressed(), Springs()
    rng, parts, clock = np.random.default_rng(0), [], 0.0
    for k in range(16):
        rate, depth = rates[k % len(rates)], (0.6, 1.0)[k // 2 % 2]
        at = np.cumsum([0.0, 0.5, (depth + 0.3) / rate, 1.5, (depth + 0.3) / rate, 0.5])
        time = np.arange(0.0, at[-1], 0.02)
        parts.append((clock + time, k, np.interp(time, at, [-0.3, -0.3, depth, depth, -0.3, -0.3])))
        clock += at[-1] + 2.0
    depth, rows = np.concatenate([d for _, _, d in parts]), sum(len(t) for t, _, _ in parts)
    episode = np.concatenate([np.full(len(t), k) for t, k, _ in parts])
    course = replace(
        made,
        time=np.concatenate([t for t, _, _ in parts]),
        episode=episode,
        averaged=np.ones(rows),
        tip=np.column_stack([0 * depth + 0.3, 0 * depth + 0.2, depth]),
        tool=np.zeros(rows, dtype=int),
        readings=np.zeros((rows, 9)),
        session=np.zeros(16, dtype=int),
        site=np.zeros(16, dtype=int),
        names=tuple(f"press {k}" for k in range(16)),
        force=None,
        tag=None,
        temperature=None,
    )
    truth = predict(course, response, [Placed(effect, {effect.parameters[0].name: np.array(size)})]).signal
    return replace(course, readings=truth + rng.normal(size=truth.shape)), response


def test_a_new_file_is_tried_and_named(newcomer):
    remark = "def remark(self, values): return 'look at the clocks'"
    effect = newcomer("at_rest = AtRest.CATCHES_UP", remark, unit="s")
    assert effect.name in {e.name for e in library()}
    course, response = read_with(effect, 0.1, (0.5, 2.0))
    conclusion = concluded(course, Setting(course, response, [effect, load("backlash"), load("drift")]))
    assert [e.placed.effect.name for e in conclusion.effects] == ["newcomer"]
    assert conclusion.status == "named" and not conclusion.effects[0].alternatives
    assert "look at the clocks" in document(conclusion, course, ([], []), {})["remarks"]


@pytest.mark.parametrize("mechanism", ["low_pass_filter", ""])
def test_another_form_of_a_mechanism_is_no_rival_of_it(newcomer, mechanism):
    effect = newcomer(f'mechanism = "{mechanism}"', unit="s")
    course, response = read_with(load("low_pass_filter"), 0.1, (0.5, 2.0))
    conclusion = concluded(course, Setting(course, response, [effect, load("low_pass_filter")]))
    (one,) = conclusion.effects
    named = {one.placed.effect.called, *one.alternatives}
    assert named == ({"low_pass_filter"} if mechanism else {"low_pass_filter", "newcomer"})


def test_one_that_equals_a_gain_without_a_force_reading_is_refused_then(newcomer):
    effect = newcomer("like_gain = LikeGain.EQUAL")
    course, response = read_with(effect, 0.1, (0.5, 2.0))
    for force, refused in ((None, True), (np.ones(course.rows), False)):
        setting = Setting(replace(course, force=force), response, [effect])
        assert (effect.name in setting.absorbed) == refused
        if refused:
            board = prepare(setting, null_model(setting)).board
            assert "calibration" in board.unjudgeable["newcomer"] and not board.candidates


def test_one_that_resembles_a_gain_is_its_rival_without_a_force_reading(newcomer):
    newcomer("like_gain = LikeGain.SIMILAR")
    prior = {"channel_gain": 0.05}
    for force, rivals in ((None, ("modulus", "newcomer", "thickness")), (np.ones(1), ())):
        setting = SimpleNamespace(
            nuisance=prior, channel_gain=load("channel_gain"), course=SimpleNamespace(force=force)
        )
        (gain,) = gains_beyond_calibration(setting, np.full(24, 0.2), np.full((2, 24), 0.2))
        assert gain.placed.effect.name == "gain" and gain.alternatives == rivals


@pytest.mark.parametrize(("size", "known"), [(0.004, True), (0.06, False)])
def test_the_scale_of_an_observer_is_known_as_well_as_it_is_calibrated(newcomer, size, known):
    effect = newcomer("scale = Scale.OBSERVER")

    def found(name, *alternatives):
        placed = Placed(name, {"k": np.array(size)})
        return Named(placed, 0, 0.9, 0.9, 0.9, None, alternatives)

    assert calibration_error(found(effect)) == known
    assert calibration_error(found(load("travel_scale"), "newcomer")) == known
    assert not calibration_error(found(load("travel_scale"))), "the drive alone has no calibrated observer"


def own_errors():
    return pose_errors(Setting(pressed(), Springs(), []), []).shape[2]


@pytest.fixture(scope="module")
def own_errors_of_the_library():
    """How many errors an episode has of its own; counted before a file is added."""
    return own_errors()


@pytest.mark.parametrize(("traits", "more"), [(("each_episode = True",), 1), ((), 0)])
def test_one_that_each_episode_has_of_its_own_is_a_nuisance(own_errors_of_the_library, newcomer, traits, more):
    newcomer(*traits)
    assert own_errors() == own_errors_of_the_library + more


def test_one_that_delays_readings_moves_the_labels_with_them(newcomer):
    effect = newcomer("def delay(self, values): return float(values['k'])", unit="s")
    placed, still = ([Placed(effect, {"k": np.array(size)})] for size in (0.4, 0.0))
    assert moves_labels(placed) and not moves_labels(still)
    recorded = [read_episode(read_session(SESSION).episodes[0])]
    (before,), (after,) = moved_episodes(recorded, still), moved_episodes(recorded, placed)
    assert np.array_equal(after.tip_ns - before.tip_ns, np.full(len(before.tip_ns), 400_000_000))
    assert np.array_equal(after.tip, before.tip)


def test_one_that_changes_the_skin_has_labels_solved_anew(newcomer):
    effect = newcomer("changes_skin = True", "def thickness_factor(self, values): return 1 + float(values['k'])")
    placed = [Placed(effect, {"k": np.array(0.1)})]
    assert moves_labels(placed) and touches_fem(placed)
    sensor = default_sensor()
    assert changed_skin(sensor, placed).skin.thickness == pytest.approx(1.1 * sensor.skin.thickness)


def test_one_that_does_neither_leaves_the_labels(newcomer):
    placed = [Placed(newcomer(), {"k": np.array(0.1)})]
    assert not moves_labels(placed) and not touches_fem(placed)
    assert changed_skin(default_sensor(), placed) is None


@pytest.mark.parametrize("seen", [True, False])
def test_a_tag_sees_what_it_can(newcomer, seen):
    effect = newcomer(f"seen_by_tag = {seen}", stage="kinematics")
    before, after = (predict(pressed(), Springs(), [Placed(effect, {"k": np.array(size)})]) for size in (0.0, 0.1))
    assert not np.array_equal(after.pose, before.pose)
    assert np.array_equal(after.tag, before.tag) != seen


def test_one_that_cannot_be_judged_is_refused_with_its_reason(newcomer):
    effect = newcomer("def unjudgeable(self, course, response): return 'no wind was recorded'")
    board = build(pressed(), Springs(), [], [effect])
    assert board.unjudgeable == {"newcomer": "no wind was recorded"} and not board.candidates


@pytest.mark.parametrize("apart", [True, False])
def test_a_fitted_response_takes_up_nothing_of_one_that_differs_between_channels(newcomer, apart):
    effect = newcomer(f"by_channel = {apart}", stage="kinematics")
    course, _ = read_with(effect, 0.1, (0.5, 2.0))
    fitted = FittedResponse(course)
    columns = taken_up(course, fitted, [Placed(effect, {"k": np.array(0.1)})])
    assert np.array_equal(columns, fitted.features(course.reduced)) == apart


@pytest.mark.parametrize(("traits", "wrong"), [(("form_error = 0.0",), False), ((), True)])
def test_an_equation_may_be_as_wrong_as_it_says(newcomer, traits, wrong):
    placed = [Placed(newcomer(*traits), {"k": np.array(0.1)})]
    columns = model_errors(pressed(), Springs(), placed).values
    assert columns.shape[2] > 0 and np.any(columns) == wrong
