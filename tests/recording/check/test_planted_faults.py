"""`tacdata check` against a table of planted faults: each is named, and nothing is said of clean recordings."""

import re
from dataclasses import replace

import numpy as np
import pytest
from recording_examples import SENSOR, T0, Press, header, plan_document, rig, rig_document

from tacdata.clock import Clock
from tacdata.devices.device import CncStatus, StreamCounts
from tacdata.plans import Plan
from tacdata.recording.check.report import check
from tacdata.recording.clocks import envelope_fit
from tacdata.recording.clocks.clock_model import StreamLatency
from tacdata.recording.clocks.polled_clock import polled_clock
from tacdata.recording.files.reader import read_recording
from tacdata.recording.files.writer import EpisodeWriter
from tacdata.recording.session import create_session, refresh

BAD, WARN = "unusable", "warning"
MS = 1_000_000
IMAGE_PERIOD = 33_333_333


class Whole(Press):
    """A press with a camera at 30 Hz whose images all differ; everything that a fault may change is an attribute."""

    def __init__(self, number=0, seed=0, rate=30.0):
        super().__init__(number, seed, rate, camera=True)
        self.header.rig["cameras"]["side"]["rate"] = 30.0
        self.header.board["format"] = {"channels": {"type": "uint16"}}
        self.header.board["rate"]["nominal"] = 30.0
        self.driver = StreamCounts(received=len(self.sample))
        self.images = list(np.arange(T0, self.end, IMAGE_PERIOD) + 40 * MS)
        self.pictures = [b"picture %d" % k for k in range(len(self.images))]
        self.numbers = list(range(len(self.images)))
        self.own = None  # the camera's own times [ns], if it has a clock
        self.eye = StreamCounts(received=len(self.images))
        self.faces, self.complete, self.reason = 2, True, ""
        self.views = []

    def write(self, path):
        writer = EpisodeWriter(path, self.header, Clock(T0, 0, 1.0), ("side",))
        self.feed(writer)
        for k, (time, picture) in enumerate(zip(self.images, self.pictures, strict=True)):
            time = int(time) + int(self.rng.integers(3 * MS))
            own = -1 if self.own is None else int(self.own[k])
            writer.image("side", time, time, self.numbers[k], picture, own)
            if k % 4 == 0:
                writer.cube("side", time, time, k, self._pose())
        sent, arrival = (np.array([getattr(s, name) for s in self.statuses]) for name in ("sent_ns", "arrival_ns"))
        models = {
            "taxels": envelope_fit.fit(self.arrival, self.counter),
            "camera side": envelope_fit.fit(
                np.array(self.images),
                np.array((self.numbers if self.own is None else self.own)[: len(self.images)]),
                "order" if self.own is None else "device_ns",
            ),
            "cnc": polled_clock(sent, arrival),
        }
        counts = {"taxels": self.driver, "camera side": self.eye}
        return writer.close(self.complete, self.reason, {k: m for k, m in models.items() if m}, counts)

    def _pose(self):
        from tacdata.recording.files.writer import CubePoseRecord

        return CubePoseRecord((0.1, 0.2, 0.4), (0.0, 0.6, 0.0, 0.8), 0.25, self.faces) if self.faces else None

    def while_still(self, phase="hold"):
        """Return the row in the middle of a still phase."""
        command = next(c for c in self.commands if c.phase == phase and not c.is_move)
        return int(np.searchsorted(self.sample, command.acknowledged_ns - 0.3e9))


FAULTS = {}


def fault(severity, stream, words, **options):
    def keep(plant):
        FAULTS[plant.__name__] = plant, severity, stream, words, options
        return plant

    return keep


@fault(WARN, "taxels", "1 frames lost")
def one_frame_lost(p):
    p.drop(40, 41)


@fault(BAD, "taxels", r"15 frames lost .* longest gap 533 ms")
def gap(p):
    p.drop(60, 75)


@fault(BAD, "taxels", "gap of 4.. ms")
def gap_that_no_counter_shows(p):
    p.counter[:] = -1
    p.sample[90:] += 400 * MS
    p.arrival[90:] += 400 * MS


@fault(WARN, "taxels", r"clock stepped by \+150 ms: it restarted")
def device_clock_steps(p):
    later = np.arange(len(p.sample)) >= 60
    p.sample, p.arrival = p.sample + later * 150 * MS, p.arrival + later * 150 * MS


@fault(WARN, "taxels", r"\+[45]\d\d ppm off", rate=30 / (1 + 500e-6))
def drift_of_500_ppm(p):
    pass


@fault(WARN, "taxels", r"-\d+ ppm off", rate=30 / (1 - 700e-6))
def drift_of_minus_700_ppm(p):
    pass


@fault(WARN, "taxels", "27.00 Hz, nominal 30 Hz", rate=27.0)
def wrong_rate(p):
    pass


@fault(WARN, "taxels", "late in reading")
def host_stalls(p):
    stalled = (p.arrival > p.arrival[50]) & (p.arrival < p.arrival[50] + 600 * MS)
    p.arrival[stalled] = p.arrival[50] + 600 * MS


@fault(WARN, "taxels", "the host read nothing for 2.. ms, then what had waited")
def host_stalls_for_a_moment(p):
    stalled = (p.arrival >= p.arrival[50]) & (p.arrival < p.arrival[50] + 290 * MS)
    p.arrival[stalled] = p.arrival[50] + 290 * MS


@fault(WARN, "taxels", "7 damaged frames")
def corrupt_frames(p):
    p.driver.corrupt = 7


@fault(WARN, "taxels", "3 frames came twice")
def repeated_frames(p):
    p.driver.repeated = 3


@fault(WARN, "taxels", "99 bytes between")
def garbage(p):
    p.driver.garbage_bytes = 99


@fault(WARN, "taxels", "the counter went from 9 to 0")
def board_restarts(p):
    p.driver.notes = ["the counter went from 9 to 0: it restarted"]


@fault(WARN, "taxels", "no counter")
def no_counter(p):
    p.counter[:] = -1


@fault(BAD, "taxels", "channel 5 stopped changing")
def dead_channel(p):
    p.counts[:, 5] = 0.0


@fault(BAD, "taxels", "channel 6 stopped changing")
def channel_sticks(p):
    p.counts[80:, 6] = p.counts[5, 6]


@fault(BAD, "taxels", "ran into a limit")
def clipped_channel(p):
    strongest = int(np.argmax(p.counts.max(axis=0) - p.counts[0]))
    p.counts[:, strongest] = np.minimum(p.counts[:, strongest], 9500)


@fault(BAD, "taxels", "channel 2 ran into a limit")
def full_scale(p):
    p.counts[100:104, 2] = 65535


@fault(BAD, "taxels", "channel 8 has readings that are no numbers")
def nan_channel(p):
    p.counts[:, 8] = np.nan


@fault(BAD, "taxels", "channel 8 has readings that are no numbers")
def one_nan(p):
    p.counts[50, 8] = np.nan


@fault(BAD, "taxels", "channels 3 and 4 read the same")
def tied_channels(p):
    p.counts[:, 4] = p.counts[:, 3]


@fault(BAD, "taxels", "the board is dead")
def frozen_board(p):
    p.counts[:] = p.counts[0]


@fault(WARN, "taxels", "channel 11 is over 5 times as noisy")
def noisy_channel(p):
    p.counts[:, 11] += np.round(p.rng.normal(0, 60, len(p.counts)))


@fault(BAD, "taxels", r"channel 10 jumps by \+1[78]\d\d counts at .* while nothing moves")
def gain_step_at_rest(p):
    p.counts[p.while_still("rest") :, 10] += 1800


@fault(BAD, "taxels", r"channel 10 jumps by [+]4\d\d\d counts")
def gain_step_in_the_hold(p):
    p.counts[p.while_still("hold") :, 10] *= 1.5


@fault(BAD, "taxels", r"channel \d+ jumps by [+](9\d|1[01]\d) counts at .* while nothing moves")
def small_step_of_the_channel_that_answers_most(p):
    p.counts[p.while_still("hold") :, int(np.argmax(p.counts[p.while_still("hold")]))] += 100


@fault(BAD, "taxels", "24 channels jump")
def supply_steps(p):
    p.counts[p.while_still("rest") :] -= 700


@fault(BAD, "cnc", "no status report")
def controller_silent(p):
    p.statuses = []


@fault(WARN, "cnc", "no status report for 2125 ms")
def controller_pauses(p):
    del p.statuses[10:26]


@fault(BAD, "cnc", "state Alarm:1")
def alarm(p):
    last = p.statuses[-1]
    p.statuses[-1] = CncStatus(last.sent_ns, last.arrival_ns, "Alarm:1", last.position, 0.0)


@fault(BAD, "cnc", r"0.2\d\d mm from the commanded position")
def guide_stops_short(p):
    hold = next(c for c in p.commands if c.phase == "hold")
    p.statuses = [
        CncStatus(s.sent_ns, s.arrival_ns, s.state, s.position + np.array([0, 0, 0.2]), s.feed)
        if hold.sent_ns < s.sent_ns < hold.acknowledged_ns
        else s
        for s in p.statuses
    ]


@fault(WARN, "taxels", r"they come \+2\d\d ms after the motion: measure the delay by a sync tap")
def readings_late(p):
    late = np.searchsorted(p.sample, p.sample - 250 * MS)
    p.counts = p.counts[late]


@fault(BAD, "taxels", r"they end \d{4} ms before the press does")
def readings_end_early(p):
    p.drop(int(np.searchsorted(p.sample, p.end - 4000 * MS)), len(p.sample))


@fault(WARN, "taxels", r"they end 3\d\d ms before the controller's reports: the press is whole")
def readings_end_after_the_press(p):
    p.drop(int(np.searchsorted(p.sample, p.end - 450 * MS)), len(p.sample))


@fault(BAD, "label", r"the guide went to x 1.00, y 0.50, depth 0.80 mm, and the label says x 3.00, y 0.50")
def label_of_another_place(p):
    object.__setattr__(p.header, "press", replace(p.header.press, x=3.0))


@fault(WARN, "taxels", r"channel 4 has a spike of \+(29|30)\d\d counts at .* while still")
def spike(p):
    p.counts[p.while_still(), 4] += 3000


@fault(WARN, "taxels", "the board repeats one frame: no channel changes for 5 frames")
def frames_held(p):
    row = p.while_still()
    p.counts[row : row + 5] = p.counts[row]


@fault(WARN, "taxels", "the board repeats one frame: no channel changes for 2 frames")
def one_frame_twice(p):
    row = p.while_still()
    p.counts[row + 1] = p.counts[row]


@fault(WARN, "camera side", "no image$")
def dead_camera(p):
    p.images, p.pictures = [], []


@fault(WARN, "camera side", r"no image for \d\.\d s")
def camera_dies(p):
    p.images, p.pictures = p.images[:60], p.pictures[:60]


@fault(WARN, "camera side", r"the same image for \d\.\d s")
def camera_hangs(p):
    p.pictures[60:] = [p.pictures[60]] * len(p.pictures[60:])


@fault(WARN, "camera side", "no tag in view in any image")
def no_tag(p):
    p.faces = 0


@fault(WARN, "camera side", "3 images lost: the host did not fetch them")
def camera_not_fetched(p):
    for name in ("images", "pictures", "numbers"):
        del getattr(p, name)[40:43]


@fault(WARN, "camera side", "4 damaged images")
def camera_sends_damage(p):
    p.eye.corrupt = 4


@fault(WARN, "camera side", "rate 60 asked, 30 given")
def camera_does_not_obey(p):
    p.eye.notes.append("camera 0: rate 60 asked, 30 given")


@fault(WARN, "camera side", r"\d+ images missing by its own times")
def camera_drops_in_its_driver(p):
    p.own = 7_000_000_000 + IMAGE_PERIOD * np.arange(len(p.images))
    kept = np.flatnonzero(np.arange(len(p.images)) % 7 != 3)
    p.images, p.pictures = [p.images[k] for k in kept], [p.pictures[k] for k in kept]
    p.own, p.numbers = p.own[kept], list(range(len(kept)))


@fault(WARN, "camera side", "images/s, nominal 30")
def camera_is_slow(p):
    p.images, p.pictures = p.images[::2], p.pictures[::2]
    p.numbers = list(range(len(p.images)))


@fault(WARN, "registration", "how and when")
def no_registration(p):
    del p.header.rig["registration"]["method"]


@fault(BAD, "recording", "the cable was pulled")
def broken_off(p):
    p.complete, p.reason = False, "the cable was pulled"


def judged(report):
    return [(f.severity, f.stream, f.text) for f in report.findings]


@pytest.mark.parametrize("name", FAULTS)
def test_a_planted_fault_is_named(tmp_path, name):
    plant, severity, stream, words, options = FAULTS[name]
    press = Whole(**options)
    plant(press)
    report = check(press.write(tmp_path / "episode-000000.mcap"))
    matching = [f for f in judged(report) if f[:2] == (severity, stream) and re.search(words, f[2])]
    assert matching, judged(report)
    assert report.usable == all(f[0] == WARN for f in judged(report))
    assert report.usable == (severity == WARN), judged(report)
    others = [f for f in judged(report) if f not in matching and f[1] != stream]
    assert others == [], "a fault of one stream is none of another"


@pytest.mark.parametrize("seed", range(8))
def test_nothing_is_said_of_a_clean_recording(tmp_path, seed):
    press = Whole(number=seed % 3, seed=seed)
    report = check(press.write(tmp_path / "episode-000000.mcap"))
    assert judged(report) == []
    assert "drift" in report.text
    assert "record --sync-tap" in report.text


def test_a_cameras_own_time_is_followed(tmp_path):
    press = Whole()
    steady = np.array(press.images)
    press.own = steady - T0 - 40 * MS + 123_456_789
    press.images = list(np.maximum.accumulate(steady + press.rng.integers(25 * MS, size=len(steady))))
    path = press.write(tmp_path / "episode-000000.mcap")
    assert judged(check(path)) == []
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.cameras["side"].device_ns, press.own)
    error = (recording.cameras["side"].sample_ns - steady) / MS
    assert np.ptp(error) < 1.0 < 5.0 < np.ptp(recording.cameras["side"].arrival_ns - steady) / MS


def test_clocks_are_shown_for_every_stream(tmp_path):
    press = Whole()
    path = tmp_path / "episode-000000.mcap"
    writer = EpisodeWriter(path, press.header, Clock(T0, 0, 1.0), ("side",))
    press.feed(writer)
    model = envelope_fit.fit(press.arrival, press.counter).with_latency(StreamLatency(6_100_000, 300_000))
    writer.close(True, "", {"taxels": model, "cnc": polled_clock(np.array([0]), np.array([8 * MS]))})
    report = check(path)
    values = report.document["episodes"][0]
    assert values["taxels"]["clock"]["latency"] == 6.1
    assert abs(values["taxels"]["clock"]["drift"]) < 100
    assert values["taxels"]["clock"]["jitter"] == pytest.approx(5 / np.sqrt(12), rel=0.2)
    assert values["cnc"]["round_trip"] == 8.0
    assert "constant delay 6.1 +- 0.3 ms taken off" in report.text


SITES = np.round(np.random.default_rng(8).uniform([-4.7, -3.7], [4.7, 3.7], (24, 2)), 2).tolist()


GAIN = np.random.default_rng(3).normal(1, 0.08, 24)


def session_of(folder, change, sites=SITES):
    """Record presses at sites; ``change(number, press)`` changes what is recorded of each."""
    document = plan_document(1)
    document["presses"] = [{"indenter": "ball", "x": x, "y": y, "depth": 0.8} for x, y in sites]
    plan = Plan.from_document(document, "many")
    made = create_session(folder, plan, SENSOR, rig_document())
    for number in range(len(sites)):
        press = Press(0, seed=number, of=replace(header(0), press=plan.presses[number]))
        press.counts = np.round(9000 + GAIN * (press.counts - 9000))
        change(number, press)
        press.write(folder / f"episode-{number:06d}.mcap")
    return check(refresh(made).folder)


def exchanged(a, b):
    order = np.arange(24)
    order[[a, b]] = b, a
    return reordered(order)


def reordered(order):
    def change(number, press):
        press.counts = press.counts[:, order]

    return change


def weaker(number, press):
    press.counts[:, 14] = 9000 + (press.counts[:, 14] - 9000) * (0.4 if number >= 12 else 1.0)


def all_stronger(number, press):
    press.counts = np.round(9000 + (press.counts - 9000) * (1.3 if number >= 12 else 1.0))


def tool_up(by, since=12):
    def change(number, press):
        if number >= since:
            tip = rig().registration.to_sensor(press.position(press.sample)) - np.array([0.0, 0.0, by])
            press.counts = np.round(9000 + GAIN * (press._counts(tip) - 9000))

    return change


def one_press_not_felt(number, press):
    if number == 7:
        press.counts = np.round(9000 + press.rng.normal(0, 5, press.counts.shape))


def one_clock_off(number, press):
    if number == 7:
        press.arrival = T0 + np.round((press.arrival - T0) * (1 + 400e-6)).astype(np.int64)


def offset(number, press):
    press.counts[:, 7] += 1500 * (number >= 10)


def louder(number, press):
    press.counts = press.counts + (number == 5) * np.round(np.random.default_rng(1).normal(0, 40, press.counts.shape))


def mute(number, press):
    press.counts[:, 9] = np.round(9000 + np.random.default_rng(number).normal(0, 5, len(press.counts)))


def no_contact(number, press):
    press.counts = np.round(9000 + np.random.default_rng(number).normal(0, 5, press.counts.shape))


def late(number, press):
    if number == 5:
        press.counts = np.roll(press.counts, 3, axis=0)


def nothing(number, press):
    pass


SESSION_FAULTS = {
    "far channels swapped": (
        exchanged(2, 21),
        [(BAD, "channel 2 answers like taxel 21"), (BAD, "channel 21 answers like taxel 2")],
    ),
    "neighbours swapped": (
        exchanged(8, 9),
        [(BAD, "channel 8 answers like taxel 9"), (BAD, "channel 9 answers like taxel 8")],
    ),
    "plug turned": (reordered(np.arange(24)[::-1]), [(BAD, "as if the array were turned by 180 deg")]),
    "gain step": (weaker, [(BAD, "channel 14 answers 0.4. times as strongly from about")]),
    "all gains": (all_stronger, [(BAD, r"all channels answer 1.[23]\d times as strongly from episode-000012")]),
    "tool slips up": (tool_up(0.3), [(BAD, r"the skin is felt about 0.(2[5-9]|3[0-5]) mm deeper from episode-000012")]),
    "tool slips up a little": (tool_up(0.12), [(WARN, r"the skin is felt about 0.1\d mm deeper from episode-000012")]),
    "tool slips down": (
        tool_up(-0.3),
        [(BAD, r"the skin is felt about 0.(2[5-9]|3[0-5]) mm higher from episode-000012")],
    ),
    "press not felt": (one_press_not_felt, [(BAD, "no channel answers to this press: the tip did not reach the skin")]),
    "clock of one recording": (
        one_clock_off,
        [(WARN, r"its clock runs \+[345]\d\d ppm otherwise than in the session's other recordings")],
    ),
    "offset step": (offset, [(WARN, r"idle reading of channel 7 steps by \+1[45]\d\d counts before episode-000010")]),
    "mute channel": (mute, [(BAD, "channel 9 did not answer")]),
    "no contact": (no_contact, [(BAD, "no channel answered to any press")]),
    "one recording late": (
        late,
        [(WARN, r"they come \+100 ms later against the motion than in other recordings: 0.10 mm of depth")],
    ),
    "louder": (louder, [(WARN, r"its noise is \d+ times that of the session's quiet recordings")]),
    "nothing": (nothing, []),
}


@pytest.mark.parametrize("name", SESSION_FAULTS)
def test_a_fault_that_only_a_session_shows_is_named(tmp_path, name):
    change, expected = SESSION_FAULTS[name]
    report = session_of(tmp_path / "session", change)
    found = judged(report)
    assert len(found) == len(expected), found
    for severity, words in expected:
        assert any(f[0] == severity and re.search(words, f[2]) for f in found), (words, found)
    fits = name not in ("no contact", "plug turned")
    assert not fits or report.not_assessed == ("whether the gain of channel 22, 23 steps: too few presses near it",)


def test_repeats_of_one_place_show_a_slip_as_well(tmp_path):
    report = session_of(tmp_path / "session", tool_up(0.3, since=9), [(0.5, 0.5)] * 16)
    assert any("mm deeper from episode-000009" in f[2] for f in judged(report)), judged(report)
    assert any("too few presses near it" in text for text in report.not_assessed), "no press was near most channels"


def test_a_session_with_few_presses_says_what_they_cannot_tell(tmp_path):
    report = session_of(tmp_path / "session", tool_up(0.3, since=3), SITES[:6])
    assert judged(report) == []
    words = "whether gains, wiring or the tool changed: 6 presses, at least 16 are needed"
    assert report.not_assessed == (words,)
    assert f"NOT ASSESSED  {words}" in report.text
    assert report.document["not_assessed"] == [words]


def test_the_first_lines_say_what_is_known_of_the_time_between_streams(tmp_path):
    press = Whole()
    path = press.write(tmp_path / "episode-000000.mcap")
    line = check(path).text.splitlines()[1]
    expected = "not measured: camera side - taxels, camera side - motion, taxels - motion (record --sync-tap)"
    assert line == f"  sync    {expected}"
    writer = EpisodeWriter(tmp_path / "episode-000001.mcap", press.header, Clock(T0, 0, 1.0), ("side",))
    press.feed(writer)
    model = envelope_fit.fit(press.arrival, press.counter).with_latency(StreamLatency(6_100_000, 300_000))
    report = check(writer.close(True, "", {"taxels": model}))
    assert report.text.splitlines()[1] == "  sync    taxels - motion +6.10 +- 0.30 ms, taken off"
    assert report.text.splitlines()[2].startswith("  sync    not measured: camera side - taxels, camera side - motion")
    pair = {"first": "taxels", "second": "motion", "offset": 6.1, "uncertainty": 0.3}
    assert pair in report.document["episodes"][0]["sync"]
