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
from tacdata.discrepancy.data.checks import DataChecks
from tacdata.discrepancy.data.identifiability import lookalikes
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.response_splines import taken_up
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.nuisances import pose_errors
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.regressors.candidates import build
from tacdata.discrepancy.regressors.model_error import model_errors
from tacdata.discrepancy.search.find import find
from tacdata.discrepancy.search.findings import FoundEffect
from tacdata.discrepancy.search.j_test import j_statistic
from tacdata.discrepancy.search.problem import prepare
from tacdata.discrepancy.search.rivals import RIVAL_Z, required_margin
from tacdata.discrepancy.verdict.calibration import calibration_error, gains_beyond_calibration
from tacdata.discrepancy.verdict.decide import decide
from tacdata.discrepancy.verdict.document import document
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


def test_a_new_file_is_raced_and_named(newcomer):
    remark = "def remark(self, values): return 'look at the clocks'"
    effect = newcomer("at_rest = AtRest.CATCHES_UP", remark, unit="s")
    assert effect.name in {e.name for e in library()}
    course, response = read_with(effect, 0.1, (0.5, 2.0))
    found = find(Setting(course, response, [effect, load("backlash"), load("drift")]))
    decision = decide(found, DataChecks(course.episodes))
    assert [e.finding.placed.effect.name for e in decision.effects] == ["newcomer"]
    assert decision.status == "named" and not decision.effects[0].finding.rivals
    assert "look at the clocks" in document(decision, found, DataChecks(course.episodes), ([], []), {})["remarks"]


@pytest.mark.parametrize("mechanism", ["low_pass_filter", ""])
def test_another_form_of_a_mechanism_is_no_rival_of_it(newcomer, mechanism):
    effect = newcomer(f'mechanism = "{mechanism}"', unit="s")
    course, response = read_with(load("low_pass_filter"), 0.1, (0.5, 2.0))
    found = find(Setting(course, response, [effect, load("low_pass_filter")]))
    (decided,) = decide(found, DataChecks(course.episodes)).effects
    named = {decided.finding.placed.effect.called, *decided.finding.rivals}
    assert named == ({"low_pass_filter"} if mechanism else {"low_pass_filter", "newcomer"})


def test_one_that_needs_two_rates_is_not_split_by_one(newcomer):
    effect = newcomer("at_rest = AtRest.CATCHES_UP", unit="s")
    course, response = read_with(effect, 0.1, (1.0,))
    others = lookalikes(course, effect, {"k": 0.1})
    assert "latency" in others and not {"backlash", "newcomer"} & set(others), "in a hold it catches up"
    assert {"latency", "backlash"} <= set(lookalikes(course, effect, {"k": 2.0})), "it does not in a short one"
    assert "newcomer" in lookalikes(course, load("latency"), {}), "nor are the others from it"
    decision = decide(find(Setting(course, response, [effect])), DataChecks(course.episodes))
    assert decision.status == "ambiguous" and "latency" in decision.effects[0].finding.rivals
    assert lookalikes(read_with(effect, 0.1, (0.5, 2.0))[0], effect, {"k": 0.1}) == ()


def test_one_without_a_trait_is_split_by_any_presses(newcomer):
    effect = newcomer()
    course, _ = read_with(effect, 0.1, (1.0,))
    assert lookalikes(course, effect, {"k": 0.1}) == ()
    assert "newcomer" not in lookalikes(course, load("latency"), {})


@pytest.mark.parametrize(("grows", "other"), [("PRESSES", "gain_drift"), ("TIME", "softening")])
def test_evenly_spaced_presses_do_not_tell_growth_by_presses_from_growth_by_time(newcomer, grows, other):
    effect = newcomer(f"grows_with = Growth.{grows}")
    even = read_with(effect, 0.1, (1.0,))[0]
    first, begins = np.flatnonzero(even.first), 50.0 * np.arange(even.episodes)
    even = replace(even, time=even.time - even.time[first][even.episode] + begins[even.episode])
    assert lookalikes(even, effect, {}) == (other,)
    rested = replace(even, time=even.time + 2000.0 * (even.episode >= 8))
    assert lookalikes(rested, effect, {}) == ()


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
        found = SimpleNamespace(
            gains=np.full(24, 0.2), halves=np.full((2, 24), 0.2), problem=SimpleNamespace(setting=setting)
        )
        (gain,) = gains_beyond_calibration(found)
        assert gain.placed.effect.name == "gain" and gain.rivals == rivals


@pytest.mark.parametrize(("size", "known"), [(0.004, True), (0.06, False)])
def test_the_scale_of_an_observer_is_known_as_well_as_it_is_calibrated(newcomer, size, known):
    effect = newcomer("scale = Scale.OBSERVER")
    found = FoundEffect(Placed(effect, {"k": np.array(size)}), {}, (), (), {}, 9.0)
    assert calibration_error(found) == known
    drive = FoundEffect(Placed(load("travel_scale"), {"k": np.array(size)}), {}, (), ("newcomer",), {}, 9.0)
    assert calibration_error(drive) == known
    assert not calibration_error(replace(drive, rivals=())), "the drive alone has no calibrated observer"


@pytest.mark.parametrize("clock", [True, False])
def test_one_that_follows_the_clock_is_held_against_others_that_do(newcomer, clock):
    effect, asked = newcomer(f"follows_clock = {clock}"), []

    class Priors:
        def get(self, kind):
            asked.append(kind)

    def model(residual, *placed):
        episode = np.repeat(np.arange(12), 10)
        return SimpleNamespace(
            left=residual,
            episode=episode,
            place=episode // 4,
            placed=placed,
            freedom=0.0,
            projected_draws=still,
            energy=0.5 * np.bincount(episode, np.square(residual).sum(axis=1)),
            knobs=[],
            loss=0.5 * float(np.square(residual).sum()),
        )

    rng, still = np.random.default_rng(0), np.zeros((120, 1, 2))
    noise = rng.normal(size=(120, 1))
    j_statistic(model(noise, SimpleNamespace(effect=effect)), model(noise + 0.5), Priors())
    assert asked == [clock]


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


def test_one_that_is_rare_has_to_be_farther_ahead(newcomer):
    effect, usual = newcomer("odds = 0.1"), load("latency")
    assert required_margin(effect, usual) == pytest.approx(np.sqrt(RIVAL_Z**2 + 2 * np.log(10)))
    assert required_margin(usual, usual) == pytest.approx(RIVAL_Z)
    assert required_margin(usual, effect) < RIVAL_Z
