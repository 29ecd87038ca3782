"""Streams of a demonstration: each recording counts its own frames, and one broken board costs no other."""

import time

import numpy as np
import pytest
from demo_examples import rig

from tacdata.clock import Clock
from tacdata.demonstrations.recording import recorder
from tacdata.demonstrations.recording.reader import read_demo
from tacdata.demonstrations.recording.recorder import DemoRecorder
from tacdata.demonstrations.recording.session import open_demo_session
from tacdata.demonstrations.recording.streams import DemoStreams
from tacdata.devices.device import Camera, ImageFrame, StreamCounts, TaxelBoard, TaxelFrame
from tacdata.errors import DeviceError


class Board(TaxelBoard):
    """A board that gives a frame every two milliseconds, and breaks after some."""

    def __init__(self, clock, most=None):
        super().__init__(clock)
        self._counts, self._most, self.quiet, self.frozen = StreamCounts(), most, False, None

    @property
    def counts(self):
        return self._counts

    def describe(self):
        return {"rate": {"nominal": 500.0}, "clock": "counter", "format": {"channels": {"type": "uint16"}}}

    def open(self):
        pass

    def close(self):
        pass

    def read(self, timeout):
        time.sleep(0.002)
        if self._most is not None and self._counts.received >= self._most:
            raise DeviceError("the line broke", "a line that holds", "check the cable")
        if self.quiet:
            return []
        self._counts.received += 1
        reading = 9000.0 + self._counts.received % 7 if self.frozen is None else self.frozen
        return [TaxelFrame(self.clock.now_ns(), self._counts.received, np.full(24, reading))]


class Sink:
    """Stands where a recording's writer would."""

    failure = None

    def __init__(self, clock):
        self.begun_ns, self.frames, self.notes = clock.now_ns(), [], []

    def taxels(self, frame, sample_ns, board=""):
        self.frames.append((board, frame.counter))

    def note(self, words, level):
        self.notes.append((words, level))


def until(true, patience=30.0):
    end = time.monotonic() + patience
    while not true() and time.monotonic() < end:
        time.sleep(0.005)
    assert true()


def recorded(streams, clock, count):
    sink = Sink(clock)
    streams.record_into(sink)
    until(lambda: len(sink.frames) > count)
    streams.catch_up()
    counts = streams.counts
    streams.record_into(None)
    return sink, counts


def test_each_recording_counts_its_own_frames():
    clock = Clock.start()
    with DemoStreams({"thumb": Board(clock)}, {}, {}, {}, None, lambda words: None) as streams:
        until(lambda: streams.heard == {"taxels thumb"})
        for count in (100, 20):
            sink, counts = recorded(streams, clock, count)
            assert abs(counts["taxels thumb"].received - len(sink.frames)) <= 2
            assert {name for name, _ in sink.frames} == {"thumb"}
            assert np.diff([number for _, number in sink.frames]).tolist() == [1] * (len(sink.frames) - 1)
        assert streams.clock_models["taxels thumb"].frames > 120


def test_a_board_that_breaks_is_said_with_what_to_do_and_costs_no_other():
    clock, said = Clock.start(), []
    boards = {"thumb": Board(clock), "index": Board(clock, most=10)}
    with DemoStreams(boards, {}, {}, {}, None, said.append) as streams:
        until(lambda: said)
        sink, _ = recorded(streams, clock, 30)
        assert said == ["taxels index: the line broke; check the cable"]
        assert sink.notes[0] == (said[0], "error") and {name for name, _ in sink.frames} == {"thumb"}


def test_a_board_that_falls_silent_may_speak_again(monkeypatch):
    monkeypatch.setattr(DemoStreams, "silence", 0.05)
    clock, said = Clock.start(), []
    board = Board(clock)
    with DemoStreams({"thumb": board}, {}, {}, {}, None, said.append) as streams:
        until(lambda: streams.heard)
        board.quiet = True
        until(lambda: "taxels thumb" in streams.silent)
        board.quiet = False
        until(lambda: not streams.silent)
    assert "nothing received for 0.05 s; check cable and power" in said[0] and "speaks again" in said[1]


class Eye(Camera):
    """A camera of 500 images a second that may repeat its latest one."""

    def __init__(self, clock):
        super().__init__(clock)
        self.number, self.frozen = 0, False

    def describe(self):
        return {}

    def open(self):
        pass

    def close(self):
        pass

    def read(self, timeout):
        time.sleep(0.002)
        self.number += not self.frozen
        return [ImageFrame(self.clock.now_ns(), self.number, np.zeros((2, 2), np.uint8), b"image %d" % self.number)]


def test_a_camera_that_repeats_one_image_is_lost(monkeypatch):
    monkeypatch.setattr(DemoStreams, "silence", 1.5)
    clock, said = Clock.start(), []
    eye = Eye(clock)
    with DemoStreams({}, {"left": eye}, {}, {}, None, said.append) as streams:
        until(lambda: eye.number > 40)
        assert not streams.lost_cameras
        eye.frozen = True
        until(lambda: streams.lost_cameras)
    assert streams.lost_cameras == {"camera left": "camera left repeats one image: it hangs"}
    assert said[0].startswith("camera left: the same image again and again for 1.5 s")


def test_a_lost_camera_ends_the_recording_as_interrupted(tmp_path, monkeypatch):
    monkeypatch.setattr(DemoStreams, "silence", 1.5)
    eyes = []

    def made(entry, kind, clock):
        if kind is Camera:
            eyes.append(Eye(clock))
        return eyes[-1] if kind is Camera else Board(clock)

    monkeypatch.setattr(recorder, "create", made)
    bench = rig(boards=("thumb",))
    session = open_demo_session(tmp_path / "demos", bench, "grasp", resume=False)
    with DemoRecorder(session, bench) as opened, pytest.raises(DeviceError, match="camera eye repeats one image: it"):
        until(lambda: eyes[0].number > 40)  # repeats of a camera whose images never differed prove nothing
        eyes[0].frozen = True
        opened.record(lambda: False, seconds=30.0)
    assert not opened.session.episodes
    (kept,) = opened.session.unfinished
    assert not read_demo(kept).complete


IMPOSSIBLE = [(9001.0, "no channel has changed for"), (65535.0, "have read 65535 counts")]


@pytest.mark.parametrize(("reading", "words"), IMPOSSIBLE)
def test_readings_that_cannot_be_are_said_within_two_seconds_and_kept_in_the_file(reading, words):
    clock, said = Clock.start(), []
    boards = {"thumb": Board(clock), "index": Board(clock)}
    with DemoStreams(boards, {}, {}, {}, None, said.append) as streams:
        until(lambda: len(streams.heard) == 2)
        sink, _ = recorded(streams, clock, 100)
        streams.record_into(sink)
        begun = time.monotonic()
        boards["index"].frozen = reading
        until(lambda: said and sink.notes)
        assert time.monotonic() - begun < 2.0
        assert said[0].startswith("taxels index: ") and words in said[0]
        assert (said[0], "error") in sink.notes
        time.sleep(0.3)
    assert len(said) == 1
