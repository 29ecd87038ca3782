"""What presses that repeat one another differ by is chance; what goes with rate or depth is not."""

from dataclasses import replace

import numpy as np
from pressing import course

from tacdata.discrepancy.model.fitted_response import FittedResponse, contexts
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.nuisances import FITTED_GAIN_PRIOR
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.noise.repeats import repeats


def places(made):
    reduced, place = made.reduced, np.zeros(made.episodes, dtype=int)
    place[reduced.episode] = contexts(reduced)
    return reduced, place


def test_repeats_share_place_depth_and_rate():
    """Two places, two depths, two rates: eight kinds of presses."""
    made = course(episodes=32)
    same = repeats(*places(made))
    deep = np.array([made.tip[made.episode == e, 2].max() > 0.8 for e in range(32)])
    long = np.array([np.ptp(made.time[made.episode == e]) for e in range(32)])
    for kind in range(same.max() + 1):
        own = same == kind
        assert len(set(made.site[own])) == 1 and len(set(deep[own])) == 1 and np.ptp(long[own]) < 0.5
    assert same.max() + 1 == 8


def test_presses_that_nobody_repeats_are_those_of_their_place():
    reduced, place = places(course(episodes=16, rates=tuple(np.geomspace(0.3, 6.0, 16))))
    assert np.array_equal(repeats(reduced, place), place)


def test_a_gain_that_goes_with_rate_is_no_gain_of_single_presses():
    """Readings are 10 % more or less with the rate: a press alone errs by far less, as repeats say."""
    made = course(episodes=32, rates=(0.4, 3.0))
    same, long = repeats(*places(made)), np.array([np.ptp(made.time[made.episode == e]) for e in range(32)])
    fast = np.array([np.median(long[same == k]) for k in same]) < np.median(long)
    gains = np.where(fast, 1.1, 0.9)[made.episode, None]
    null = null_model(Setting(replace(made, readings=5000 + (made.readings - 5000) * gains), FittedResponse(made), []))
    assert null.sizes is not None and null.sizes[1] * FITTED_GAIN_PRIOR < 0.03
