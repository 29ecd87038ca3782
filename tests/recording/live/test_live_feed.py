"""What a viewer is shown while recording, and that it cannot disturb."""

import numpy as np
from device_doubles import Board, Controller, Eye
from recording_examples import SENSOR, plan, rig

from tacdata.clock import Clock
from tacdata.recording.files.reader import read_recording
from tacdata.recording.live.live_feed import LiveFeed
from tacdata.recording.live.rig_devices import RigDevices
from tacdata.recording.recorder import Recorder


def test_a_feed_is_thinned_out():
    shown = []
    feed = LiveFeed(lambda *what: shown.append(what))
    for k in range(500):
        feed.taxels(k, np.zeros(24))
        feed.position(k, (0.0, 0.0, 0.0))
        feed.image("left", k, np.zeros((2, 2), np.uint8))
    streams = [stream for stream, _, _ in shown]
    assert set(streams) == {"taxels", "cnc", "camera left"}
    assert len(shown) < 60


def test_a_viewer_that_breaks_is_not_asked_again():
    asked = []

    def broken(*what):
        asked.append(what)
        raise RuntimeError("the window was closed")

    feed = LiveFeed(broken)
    for k in range(5):
        feed.taxels(k, np.zeros(24))
        feed._shown.clear()
    assert len(asked) == 1


def test_a_recording_shows_all_its_streams_and_loses_nothing(tmp_path):
    from dataclasses import replace

    clock, shown = Clock.start(10.0), []
    bench = replace(rig(camera=True), clock=clock)
    cnc = Controller(clock)
    devices = RigDevices(cnc, Board(clock, cnc), {"side": Eye(clock)})
    session = Recorder(
        bench,
        SENSOR,
        plan(1, hold=0.3, rest=0.4),
        tmp_path / "session",
        devices=devices,
        watch=lambda *what: shown.append(what),
    ).run(lambda summary: True)
    assert {stream for stream, _, _ in shown} == {"taxels", "cnc", "camera side"}
    recording = read_recording(session.episodes[0])
    assert (np.diff(recording.episode.taxels.counter) == 1).all()
    assert {"cnc", "taxels", "camera side"} <= {"cnc"} | set(recording.clocks)
    assert recording.polled["frames"]
