"""The smallest gain that holds an object again and again, found by trying."""

import functools
from dataclasses import replace

import pytest
from test_scene import grasp

from tacdata.errors import UsageError
from tacdata.replay.comparison.gain_search import PRELIMINARY, GripDemand, GripSearch
from tacdata.replay.outcome import replay_targets
from tacdata.replay.scene import ReplayScene, drawn


@functools.cache
def replayed():
    return replay_targets(grasp(0.01)[0], ReplayScene(), grasp()[1])


def made(held=True, slip=0.001, force=2.0, grip=2.0):
    return replace(replayed(), held=held, slip=slip, force={"thumb": force, "index": force / 2}, grip=grip)


def test_the_first_gain_that_holds_every_trial_is_taken():
    """A larger gain may push the object away: the first stretch of gains that holds counts."""
    found = GripSearch(lambda gain, seed: made(0.0041 + 1e-4 * (seed % 3) < gain < 0.009)).find()
    assert 0.0043 < found.gain < 0.0043 + 2e-4 and found.demand.trials == 20


@pytest.mark.parametrize("worse", [{"slip": 0.0031}, {"force": 6.1}, {"grip": 1.9}, {"held": False}])
def test_one_trial_that_slides_presses_too_hard_or_drops_refuses_a_gain(worse):
    def outcome(gain, seed):
        return made(**(worse if seed == PRELIMINARY + 7 and gain < 0.012 else {"grip": 2.0 + gain}))

    found = GripSearch(outcome, GripDemand(trials=9)).find()
    assert 0.012 <= found.gain < 0.0122 and found.grip == pytest.approx(2.0 + found.gain)
    with pytest.raises(UsageError, match=r"with 0.0300 m/mm: .* a pad pressed with"):
        GripSearch(lambda gain, seed: made(**worse)).find()


@pytest.mark.long("tacdata/replay", reason="a gain is looked for among whole trials, then tried on ten more")
def test_the_gain_that_is_found_holds_scenes_that_the_search_has_not_seen():
    _, centre = grasp()

    def outcome(gain, seed):
        return replay_targets(grasp(gain)[0], drawn(ReplayScene(), 3, seed), centre)

    found = GripSearch(outcome, GripDemand(trials=6), tolerance=1e-3).find()
    assert found.slip <= 0.003 and found.force <= 6.0 and found.grip >= 2.0
    assert all(outcome(found.gain, seed).held for seed in range(10))
    assert not any(outcome(0.0, seed).held for seed in range(3))
