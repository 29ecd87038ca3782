import numpy as np
import pytest

from tacdata.recording.clock_model import ClockModel, EnvelopeFit, fit

START = 1_760_000_000_000_000_000


def arrivals(rng, n, rate, drift, delay):
    """True sample times on the host's clock and arrivals in order, as a serial link gives them."""
    true = START + np.rint(np.arange(n) * 1e9 / rate * (1 + drift)).astype(np.int64)
    return true, np.maximum.accumulate(true + np.rint(delay * 1e9).astype(np.int64))


def test_perfect_link_is_reproduced_exactly():
    counter = np.arange(1000, 1300)
    arrival = START + 10_000_000 * (counter - 1000)
    model = fit(arrival, counter)
    assert model is not None
    np.testing.assert_array_equal(model.sample_ns(counter), arrival)


@pytest.mark.parametrize("drift", [-200e-6, 0.0, 200e-6])
def test_usb_link_at_100_hz_within_a_millisecond(drift):
    rng = np.random.default_rng(1)
    true, arrival = arrivals(rng, 6000, 100.0, drift, 0.0005 + rng.exponential(0.001, 6000))
    model = fit(arrival, np.arange(6000))
    error = (model.sample_ns(np.arange(6000)) - true) / 1e6
    assert np.abs(error).max() < 1.0
    assert model.period_ns == pytest.approx(1e7 * (1 + drift), rel=2e-6)


def test_ftdi_bursts_and_host_stalls_stay_bounded_where_raw_arrival_is_not():
    rng = np.random.default_rng(2)
    true, arrival = arrivals(rng, 6000, 100.0, 60e-6, 0.001 + rng.exponential(0.0003, 6000))
    arrival = START + -(-(arrival - START) // 16_000_000) * 16_000_000  # the adapter's 16 ms latency timer
    stalls = rng.random(6000) < 0.01
    arrival = np.maximum.accumulate(np.where(stalls, arrival + 80_000_000, arrival))
    counter = np.arange(6000)
    error = (fit(arrival, counter).sample_ns(counter) - true) / 1e6
    raw = (arrival - true) / 1e6
    assert raw.mean() > 8
    assert np.abs(error).max() < 2.0


def test_lost_frames_do_not_shift_the_line():
    rng = np.random.default_rng(3)
    counter = np.arange(2000)
    true, arrival = arrivals(rng, 2000, 30.0, 100e-6, 0.002 + rng.exponential(0.002, 2000))
    kept = rng.random(2000) > 0.2
    error = fit(arrival[kept], counter[kept]).sample_ns(counter) - true
    assert np.abs(error / 1e6).max() < 3.0


def test_running_fit_equals_the_batch_fit_and_keeps_hulls_only():
    rng = np.random.default_rng(4)
    _, arrival = arrivals(rng, 20_000, 100.0, 50e-6, rng.exponential(0.002, 20_000))
    running = EnvelopeFit()
    for count, time in enumerate(arrival.tolist()):
        running.add(time, count)
    assert running.model() == fit(arrival, np.arange(20_000))
    assert sum(len(block) for block in running._blocks) < 2500


def test_reset_of_the_device_starts_anew_and_unknown_counters_give_no_model():
    running = EnvelopeFit()
    for k in range(100):
        running.add(START + k * 10_000_000, 5000 + k)
    for k in range(100):
        running.add(START + (200 + k) * 10_000_000, k)
    assert running.model().sample_ns(np.array([0]))[0] == START + 2_000_000_000
    assert fit(np.array([START, START + 1]), np.array([-1, -1])) is None
    assert fit(np.array([START]), np.array([0])) is None


def test_model_survives_its_document():
    model = ClockModel(7, START, 33_333_333.25, 900)
    assert ClockModel.from_document(model.document) == model
