"""Every image has a time and an uncertainty: late, lost and stamped images, with and without a nominal rate."""

import numpy as np
import pytest

from tacdata.recording.clocks.clock_model import StreamLatency
from tacdata.recording.clocks.image_clock import image_clock
from tacdata.recording.clocks.running_clock import StreamClock

START = 1_700_000_000_000_000_000
DELAY = 0.05
"""Smallest latency, which the clock is told [s]."""


def errors(times, arrivals, stamped=False, rate=20.0, stamps=None):
    """Errors of the times [s], and their uncertainties [s]; the camera is open five seconds before time 0."""
    arrival, exposed = (START + np.rint(values * 1e9).astype(np.int64) for values in (arrivals, times))
    marks = times if stamps is None else stamps
    stamped = stamped or stamps is not None
    device = np.rint(marks * 1e9).astype(np.int64) + 10**13 if stamped else np.full(len(times), -1)
    number = np.arange(len(times))
    clock = StreamClock("device_ns" if stamped else "order")
    clock.set_latency(StreamLatency(int(DELAY * 1e9), 2_000_000))
    for k in number:
        clock.take(int(arrival[k]), int(device[k] if stamped else k))
    rows = arrivals >= 0
    own = image_clock(arrival[rows], number[rows], device[rows], clock.model(), rate)
    off = (own.sample_times(arrival[rows], number[rows]) - exposed[rows]) * 1e-9
    return off, own.uncertainties(number[rows]), times[rows]


def images(seed, seconds=18.0, rate=20.0):
    """Exposures and arrivals of a camera that is on time [s]."""
    rng = np.random.default_rng(seed)
    times = np.arange(-5.0, seconds, 1 / rate)
    return times, times + DELAY + rng.uniform(0, 0.01, len(times))


@pytest.mark.parametrize("stamped", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_ten_seconds_of_lateness_that_end_are_taken_off(seed, stamped):
    times, arrivals = images(seed)
    arrivals = np.maximum.accumulate(arrivals + 0.2 * ((times > 4) & (times < 14)))
    off, sigma, _ = errors(times, arrivals, stamped)
    assert (np.abs(off) < 3 * sigma).mean() > 0.99 and np.abs(off[:-5]).max() < 0.006 and sigma.max() < 0.01


def test_lateness_that_lasts_to_the_end_is_known_by_stamps_and_else_uncertain():
    times, arrivals = images(0)
    arrivals = arrivals + 0.2 * (times > 8)
    off, sigma, when = errors(times, arrivals)
    assert off[when > 9].min() > 0.19 and (np.abs(off) < 3 * sigma).all()
    assert sigma[when > 9].min() > 0.08 and sigma[when < 7].max() < 0.01
    off, sigma, _ = errors(times, arrivals, stamped=True)
    assert np.abs(off).max() < 0.005 and sigma.max() < 0.01


def test_late_from_before_the_recording_is_found_by_the_images_that_are_not():
    times, arrivals = images(1)
    off, sigma, _ = errors(times, np.maximum.accumulate(arrivals + 0.2 * (times < 9)))
    assert (np.abs(off) < 3 * sigma).mean() > 0.99 and np.abs(off[:-5]).max() < 0.006


@pytest.mark.parametrize("stamped", [False, True])
def test_a_lost_image_may_be_a_late_one(stamped):
    times, arrivals = images(2)
    kept = np.arange(len(times)) != 250
    off, sigma, when = errors(times[kept], arrivals[kept], stamped)
    assert np.abs(off).max() < 0.012 and (np.abs(off) < 3 * sigma).mean() > 0.99
    later = when > times[250]
    assert (0.02 < sigma[later][5:].min() < 0.03) is not stamped and sigma[~later].max() < 0.01


@pytest.mark.parametrize("rate", [19.9, 20.05, 29.97])
def test_a_rate_that_is_not_nominal_is_found(rate):
    times, arrivals = images(3, rate=rate)
    off, sigma, _ = errors(times, np.maximum.accumulate(arrivals + 0.2 * ((times > 4) & (times < 9))), rate=round(rate))
    assert (np.abs(off) < 3 * sigma).mean() > 0.99 and sigma.max() < 0.02


STAMPS = {
    "clock set forward": lambda times: times + 0.33 * (times > 7),
    "clock set back": lambda times: times - 0.33 * (times > 7),
    "clock set back by less than a period": lambda times: times - 0.03 * (times > 7),
    "clock set twice": lambda times: times + 0.02 * (times > 3) - 0.61 * (times > 12),
    "slow by 0.1 %": lambda times: 1.001 * times,
    "in microseconds": lambda times: 0.001 * times,
    "of batches of four": lambda times: (
        times[np.minimum(np.arange(len(times)) // 4 * 4 + 3, len(times) - 1)] + 0.0002 * (np.arange(len(times)) % 4)
    ),
}
"""Wrong stamps -> stamps of exposures [s]."""


@pytest.mark.parametrize("kind", STAMPS)
@pytest.mark.parametrize("late", [0.0, 0.2])
def test_stamps_that_are_wrong_do_not_make_times_wrong(kind, late):
    times, arrivals = images(4)
    arrivals = np.maximum.accumulate(arrivals + late * ((times > 9) & (times < 11)))
    off, sigma, _ = errors(times, arrivals, stamps=STAMPS[kind](times))
    assert (np.abs(off) < 3 * sigma).mean() > 0.98 and np.abs(off[:-5]).max() < 0.012 and np.median(sigma) < 0.01


def test_a_clock_set_forward_by_whole_periods_as_nothing_else_changes_leaves_a_doubt():
    times, arrivals = images(5)
    off, sigma, when = errors(times, arrivals, stamps=times + 0.2 * (times > 7 - 1e-6))
    assert (np.abs(off) < 3 * sigma).all() and sigma[when < 6.9].min() > 0.19 and sigma[when > 7.1].max() < 0.01


def test_neighbours_that_arrive_in_the_wrong_order_are_put_right_by_their_stamps():
    times, arrivals = images(6)
    order = np.arange(len(times))
    for k in (150, 200, 201, 310):
        order[[k, k + 1]] = order[[k + 1, k]]
        arrivals[k] = arrivals[k + 1]
    off, sigma, _ = errors(times[order], arrivals, stamps=times[order])
    assert (np.abs(off) < 3 * sigma).all() and np.abs(off).max() < 0.005


@pytest.mark.parametrize("rate", [None, 30.0, 10.0])
def test_a_rate_that_the_rig_file_has_wrong_or_not_costs_nothing(rate):
    times, arrivals = images(7)
    off, sigma, _ = errors(times, arrivals, rate=rate)
    assert (np.abs(off) < 3 * sigma).mean() > 0.99 and sigma.max() < 0.02


def test_a_camera_that_goes_on_at_half_its_rate_is_not_late_before():
    times, arrivals = images(8)
    kept = (times < 4) | (np.arange(len(times)) % 2 == 0)
    off, sigma, _ = errors(times[kept], arrivals[kept], rate=None)
    assert (np.abs(off) < 3 * sigma).mean() > 0.99 and np.abs(off).max() < 0.012


def test_too_few_images_have_no_clock():
    none = np.zeros(2, np.int64)
    assert image_clock(none, np.arange(2), none - 1, None) is None


@pytest.mark.parametrize("size", [2, 3, 4, 5])
@pytest.mark.parametrize("stamped", [False, True])
def test_batches_need_no_nominal_rate(size, stamped):
    """Images are held back and arrive together, half a millisecond apart, with stamps of the batch."""
    times, arrivals = images(7)
    place = np.arange(len(times)) % size
    last = np.minimum(np.arange(len(times)) - place + size - 1, len(times) - 1)
    stamps = times[last] + 0.0002 * place if stamped else None
    off, sigma, _ = errors(times, arrivals[last] + 0.0005 * place, rate=None, stamps=stamps)
    assert (np.abs(off) < 3 * sigma).mean() > 0.98 and np.abs(off[:-5]).max() < 0.012 and np.median(sigma) < 0.01
