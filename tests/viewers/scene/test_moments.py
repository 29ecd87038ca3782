from dataclasses import replace

import numpy as np

from tacdata.viewers.scene.moments import moments, nearest
from tacdata.viewers.scenes.episode import episode_scene


def test_the_moments_of_a_press_lie_before_in_and_after_its_hold(episode, label):
    found = dict(moments(episode_scene(episode, label)))
    start = episode.taxels.sample_ns[0]
    seconds = {name: (time - start) / 1e9 for name, time in found.items()}
    assert 1.5 < seconds["half way in"] < 2.0
    assert 2.3 < seconds["deepest"] < 2.9
    assert 3.2 < seconds["half way out"] < 3.6


def test_without_maps_the_signal_tells_the_moments(episode):
    found = dict(moments(episode_scene(episode)))
    assert 2.2e9 < found["deepest"] - episode.taxels.sample_ns[0] < 3.0e9


def test_a_press_that_breaks_off_has_no_way_out(episode, label):
    short = replace(
        label, time_ns=label.time_ns[:80], signed=label.signed[:80], tip=label.tip[:80], force=label.force[:80]
    )
    assert [name for name, _ in moments(episode_scene(episode, short))] == ["half way in", "deepest"]


def test_no_contact_at_all_still_has_one_moment(episode, label):
    flat = replace(label, signed=np.zeros_like(label.signed))
    assert "deepest" in dict(moments(episode_scene(episode, flat)))


def test_nearest():
    assert nearest(np.array([0, 10, 20]), 14) == 1
