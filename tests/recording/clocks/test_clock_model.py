import time

import numpy as np
import pytest
from recording_examples import Press

from tacdata.clock import Clock
from tacdata.recording.clocks.clock_model import ClockModel, StreamLatency
from tacdata.recording.clocks.envelope_fit import EnvelopeFit, fit
from tacdata.recording.clocks.polled_clock import polled_clock
from tacdata.recording.clocks.running_clock import StreamClock
from tacdata.recording.clocks.stream_pairs import stream_pairs
from tacdata.recording.files.mcap_records import read_records

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
    for count, moment in enumerate(arrival.tolist()):
        running.add(moment, count)
    assert running.model() == fit(arrival, np.arange(20_000))
    assert sum(len(block.hull) for block in running._stretch.blocks) < 2500


def test_reset_of_the_device_starts_anew_and_unknown_counters_give_no_model():
    running = EnvelopeFit()
    for k in range(100):
        running.add(START + k * 10_000_000, 5000 + k)
    for k in range(100):
        running.add(START + (200 + k) * 10_000_000, k)
    assert running.model().sample_ns(np.array([0]))[0] == START + 2_000_000_000
    assert fit(np.array([START, START + 1]), np.array([-1, -1])) is None
    assert fit(np.array([START]), np.array([0])) is None


def link(seed, rate, seconds, kind, drift):
    """True times and arrivals of a link of that kind, with a delay of 2 ms at least."""
    rng = np.random.default_rng(seed)
    count = int(rate * seconds)
    true, arrival = arrivals(rng, count, rate, drift, 0.002 + rng.exponential(0.0005, count))
    if "ftdi" in kind:
        begin = START + int(rng.integers(16_000_000))
        arrival = begin + -(-(arrival - begin) // 16_000_000) * 16_000_000
    time = START
    while "stall" in kind and time < true[-1]:
        time += int(rng.exponential(1e9))
        length = int(rng.uniform(0.01, 0.3) * 1e9)
        stalled = (arrival >= time) & (arrival < time + length)
        arrival[stalled] = time + length
    return rng, true, np.maximum.accumulate(arrival)


@pytest.mark.parametrize("kind", ["usb", "ftdi", "stall", "ftdi and stall"])
@pytest.mark.parametrize(("rate", "limit"), [(30.0, 3.0), (100.0, 1.0), (1000.0, 1.0)])
def test_every_link_is_known_up_to_a_constant(kind, rate, limit):
    for seed in range(4):
        drift = np.random.default_rng(seed).uniform(-200e-6, 200e-6)
        rng, true, arrival = link(seed, rate, 20.0 if rate > 500 else 120.0, kind, drift)
        counter = np.arange(len(true)) + 60_000
        kept = rng.random(len(true)) > 0.03
        model = fit(arrival[kept], counter[kept])
        error = (model.sample_times(arrival[kept], counter[kept]) - true[kept]) / 1e6 - 2.0
        constant = (error.max() + error.min()) / 2
        assert model.earlier == ()
        assert np.abs(error - constant).max() < limit
        assert -0.1 < constant < 2.0
        assert abs(model.drift(1e9 / rate) - drift * 1e6) < 3 * model.drift_uncertainty * 1e6 + 1.0


def busy_host(rng, arrival):
    """A host that gets 5 ms of every 35: what arrives while it waits is stamped when it runs again."""
    late, time = arrival.copy(), START
    while time < arrival[-1]:
        time += int(rng.exponential(5e6))
        runs = time + int(rng.exponential(30e6))
        waiting = (arrival >= time) & (arrival < runs)
        late[waiting] = np.maximum(late[waiting], runs)
        time = runs
    return np.maximum.accumulate(late)


@pytest.mark.parametrize("seconds", [4.0, 20.0, 60.0])
def test_a_host_that_hardly_runs_does_not_look_like_steps_of_the_device(seconds):
    for seed in range(12):
        rng, true, arrival = link(seed, 30.0, seconds, "ftdi", rng_drift(seed))
        counter = np.arange(len(true))
        model = fit(busy_host(rng, arrival), counter, nominal_ns=1e9 / 30)
        assert model.earlier == ()
        error = (model.sample_ns(counter) - true) / 1e6
        assert np.ptp(error) / 2 < 3.0


def rng_drift(seed):
    return np.random.default_rng(seed).uniform(-200e-6, 200e-6)


def test_a_board_that_is_not_what_it_is_said_to_be_is_followed_all_the_same():
    _, true, arrival = link(4, 100.0, 10.0, "ftdi", 0.01)
    model = fit(arrival, np.arange(1000), nominal_ns=1e7)
    assert model.period_ns == pytest.approx(1e7 * 1.01, rel=3e-4)
    assert np.ptp(model.sample_ns(np.arange(1000)) - true) / 2e6 < 1.6


def test_a_stall_of_seconds_is_no_step_of_the_device():
    _, true, arrival = link(5, 100.0, 60.0, "usb", 50e-6)
    stalled = (arrival > START + 20_000_000_000) & (arrival < START + 26_000_000_000)
    arrival[stalled] = START + 26_000_000_000
    model = fit(arrival, np.arange(len(true)))
    assert model.earlier == ()
    assert np.abs(model.sample_ns(np.arange(len(true))) - true).max() / 1e6 < 2.1


def test_a_host_that_is_late_for_long_and_then_is_not_has_not_stepped():
    _, true, arrival = link(11, 100.0, 60.0, "usb", 30e-6)
    busy = (arrival > START + 20_000_000_000) & (arrival < START + 26_000_000_000)
    arrival[busy] += 60_000_000
    arrival = np.maximum.accumulate(arrival)
    running = EnvelopeFit()
    for count, moment in enumerate(arrival.tolist()):
        running.add(moment, count)
        if count == 2400:
            assert len(running.model().earlier) == 1, "so it looked for a while"
    assert running.model().earlier == ()
    assert running.model().frames == 6000
    assert np.abs(running.model().sample_times(arrival, np.arange(6000)) - true).max() / 1e6 < 2.1


@pytest.mark.parametrize("gap", [0.05, 2.0, 30.0])
def test_a_device_that_pauses_or_restarts_begins_a_new_line(gap):
    _, true, arrival = link(6, 100.0, 60.0, "usb", -80e-6)
    after = np.arange(len(true)) >= 2500
    true, arrival = true + after * round(gap * 1e9), arrival + after * round(gap * 1e9)
    for counter in (np.arange(6000), np.where(after, np.arange(6000) - 2500, np.arange(6000) + 9000)):
        model = fit(arrival, counter)
        assert len(model.earlier) == 1
        assert np.abs(model.sample_times(arrival, counter) - true).max() / 1e6 < 2.1
    model = fit(arrival, np.arange(6000))
    assert model.steps_ns[0] / 1e9 == pytest.approx(gap, abs=1e-3)


def test_a_counter_that_jumps_without_time_begins_a_new_line():
    _, true, arrival = link(7, 100.0, 60.0, "usb", 20e-6)
    counter = np.arange(6000) + 256 * (np.arange(6000) > 3000)
    model = fit(arrival, counter)
    assert len(model.earlier) == 1
    assert np.abs(model.sample_times(arrival, counter) - true).max() / 1e6 < 2.1


def test_the_devices_own_time_is_followed_where_sampling_is_irregular():
    rng = np.random.default_rng(8)
    device = np.cumsum(rng.integers(5_000_000, 40_000_000, 3000))
    true = START + np.rint(device * (1 + 150e-6)).astype(np.int64)
    arrival = np.maximum.accumulate(true + np.rint((0.001 + rng.exponential(0.004, 3000)) * 1e9).astype(np.int64))
    model = fit(arrival, device, "device_ns")
    assert np.abs(model.sample_times(arrival, device) - true).max() / 1e6 < 1.3
    assert model.drift(0.0) == pytest.approx(150, abs=3)


def test_numbers_given_on_arrival_are_left_alone_when_they_fit_no_line():
    rng = np.random.default_rng(9)
    arrival = START + np.cumsum(rng.integers(20_000_000, 400_000_000, 500))
    model = fit(arrival, np.arange(500), "order")
    assert not model.steady
    moved = model.with_latency(StreamLatency(40_000_000, 1_000_000))
    np.testing.assert_array_equal(moved.sample_times(arrival, np.arange(500)), arrival - 40_000_000)


def test_a_wall_clock_that_steps_does_not_reach_the_streams(monkeypatch):
    clock = Clock.start()
    before = clock.now_ns()
    monkeypatch.setattr(time, "time_ns", lambda: 0)
    monkeypatch.setattr(time, "time", lambda: 0.0)
    assert 0 <= clock.now_ns() - before < 1_000_000_000


def test_a_stream_is_timed_while_it_arrives():
    _, true, arrival = link(10, 100.0, 20.0, "ftdi", 60e-6)
    clock = StreamClock()
    sample = np.array([clock.take(int(a), k) for k, a in enumerate(arrival)])
    assert (sample <= arrival).all()
    assert np.abs((sample - true)[500:] / 1e6 - 3.0).max() < 2.0
    clock.set_latency(StreamLatency(2_000_000, 100_000))
    assert clock.model().latency == clock.latency
    assert StreamClock().take(5, -1) == 5


def test_a_measured_delay_holds_when_the_line_finds_quicker_arrivals():
    """Frames at 100 Hz slide through a latency timer of 16 ms within half a minute: the line sinks by up to 2 ms."""
    worst = []
    for seed in range(6):
        _, true, arrival = link(seed, 100.0, 120.0, "ftdi", rng_drift(seed))
        counter = np.arange(len(true))
        clock, plain = StreamClock(nominal_ns=1e7), StreamClock(nominal_ns=1e7)
        for k in range(2000):
            clock.take(int(arrival[k]), k)
        middle = slice(500, 1500)
        tap = np.mean(clock.model().sample_times(arrival[middle], counter[middle]) - true[middle])
        clock.set_latency(StreamLatency(round(tap), 100_000))
        for k in range(2000, len(true)):
            clock.take(int(arrival[k]), k)
        for k in range(len(true)):
            plain.take(int(arrival[k]), k)
        fixed = plain.model().with_latency(StreamLatency(round(tap), 100_000))
        error = [(m.sample_times(arrival, counter) - true) / 1e6 for m in (clock.model(), fixed)]
        worst.append([np.abs(e).max() for e in error])
    followed, kept = np.array(worst).T
    assert followed.max() < 1.0
    assert followed.mean() < 0.7 * kept.mean(), "a delay that does not follow the line is wrong by what it sinks"


def test_a_camera_that_skips_images_keeps_the_delay_that_was_measured():
    """Images are numbered on arrival: those that are skipped bend the line, so the delay is one of the arrivals."""
    rng = np.random.default_rng(1)
    clock, delay = StreamClock("order", nominal_ns=None), StreamLatency(41_000_000, 300_000)
    exposed = np.flatnonzero(rng.random(3000) > 0.06) * 33_333_333
    arrival = START + exposed + 40_000_000 + rng.integers(0, 2_000_000, len(exposed))
    for k in range(600):
        clock.take(int(arrival[k]), k)
    assert not clock.model().steady
    clock.set_latency(delay)
    for k in range(600, len(exposed)):
        clock.take(int(arrival[k]), k)
    model = clock.model()
    assert not model.steady
    assert model.latency == delay
    assert np.abs(model.sample_times(arrival, np.arange(len(arrival))) - START - exposed).max() < 2_000_000


def test_a_delay_that_was_measured_against_arrivals_is_none_of_a_line():
    clock = StreamClock("order")
    clock.take(START, 0)
    for k in range(1, 400):  # a camera that begins to skip after the tap
        clock.take(START + k * 33_333_333, k)
    clock.set_latency(StreamLatency(41_000_000, 300_000))
    assert clock.model().latency is not None
    skipped = np.cumsum(np.random.default_rng(2).random(2000) < 0.08)
    for k in range(400, 2000):
        clock.take(START + (k + int(skipped[k])) * 33_333_333, k)
    assert not clock.model().steady
    assert clock.model().latency is None


def test_polled_answers_lie_between_query_and_receipt():
    sent = np.arange(10) * 100
    assert polled_clock(sent, sent + 8).document["round_trip_ns"] == "8"
    assert polled_clock(np.array([]), np.array([])) is None


def test_model_survives_its_document():
    old = ClockModel(7, START, 33_333_333.25, 900)
    assert ClockModel.from_document(old.document) == old
    whole = ClockModel(9, START, 1e7, 80, START, 2e6, 1e6, 5e5, 0.001, "device_ns", None, (old,))
    whole = whole.with_latency(StreamLatency(6_000_000, 200_000))
    assert ClockModel.from_document(whole.document) == whole


def test_every_pair_of_streams_says_its_offset_or_that_it_was_not_measured():
    known = {"taxels": StreamLatency(6_100_000, 300_000), "camera a": StreamLatency(40_000_000, 400_000)}
    pairs = {pair.name: pair.words for pair in stream_pairs({**known, "camera b": None})}
    assert pairs["taxels - motion"] == "+6.10 +- 0.30 ms, taken off"
    assert pairs["camera a - taxels"] == "+33.90 +- 0.50 ms, taken off"
    assert pairs["camera b - taxels"] == pairs["camera b - motion"] == "not measured"
    assert len(pairs) == 6
    assert len(stream_pairs({"taxels left": None, "camera a": None}, motion=False)) == 1


def test_the_pairs_stand_in_the_file(tmp_path):
    metadata = read_records(Press().write(tmp_path / "episode-000000.mcap")).metadata
    assert metadata["sync"] == {"taxels - motion": "not measured"}


def test_a_board_without_a_clock_and_a_camera_stand_in_the_pairs_too(tmp_path):
    press = Press(camera=True)
    press.counter[:] = -1
    metadata = read_records(press.write(tmp_path / "episode-000000.mcap")).metadata
    names = ["camera side - taxels", "camera side - motion", "taxels - motion"]
    assert metadata["sync"] == dict.fromkeys(names, "not measured")


def test_a_stall_of_minutes_ago_does_not_count_as_the_links_delay():
    rng = np.random.default_rng(8)
    true, arrival = arrivals(rng, 9000, 30.0, 50e-6, 0.002 + rng.exponential(0.003, 9000))
    stalled = (arrival > START + 20_000_000_000) & (arrival < START + 140_000_000_000)
    arrival[stalled] = START + 140_000_000_000  # two minutes, read at once
    model = fit(arrival, np.arange(9000), nominal_ns=1e9 / 30)
    assert (arrival[stalled] - true[stalled]).mean() > 5e10
    assert model.delay_ns < 6e6
    assert model.jitter_ns < 6e6
    error = (model.sample_ns(np.arange(9000)) - true) / 1e6
    assert np.abs(error[6000:]).max() < 4.0
