"""What a recording keeps of cameras: the images as they came, and fingertips."""

import json
from concurrent.futures import Future
from dataclasses import replace

import cv2
import numpy as np
import pytest
from device_doubles import Board, Controller, Eye
from recording_examples import SENSOR, T0, header, plan, rig, rig_document
from scipy.spatial.transform import Rotation

from tacdata.clock import Clock
from tacdata.devices.device import ImageFrame, StreamCounts
from tacdata.errors import FormatError
from tacdata.recording.check.report import check
from tacdata.recording.files.mcap_records import read_records
from tacdata.recording.files.reader import read_recording
from tacdata.recording.files.writer import EpisodeWriter
from tacdata.recording.live.camera_stream import CameraStream
from tacdata.recording.live.detection_process import in_background
from tacdata.recording.live.rig_devices import RigDevices
from tacdata.recording.recorder import Recorder
from tacdata.rig import read_rig
from tacdata.rig import rig as rig_file
from tacdata.tags import fingers_of, look
from tacdata.virtual_rig.optics.look import Look
from tacdata.virtual_rig.optics.render import render_scene

VIEW = {"width": 960, "height": 540, "fx": 900.0, "fy": 900.0, "cx": 479.5, "cy": 269.5}
FACES = ("+x", "-x", "+y", "-y", "+z")
TIP = {"position": [10.0, 0.0, -18.0], "quaternion": [1.0, 0.0, 0.0, 0.0]}
NAMES = ("thumb", "index")
FINGERS = {
    "version": "1.0",
    "fingers": {
        name: {"cube": {"side": 20.0, "tag": 16.0, "ids": {f: 5 * n + k for k, f in enumerate(FACES)}}, "tip": TIP}
        for n, name in enumerate(NAMES)
    },
}


def at_once(image, intrinsics, what, hint):
    found = Future()
    found.set_result(look(image, intrinsics, what, hint))
    return found


def pose(place, angles):
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    matrix[:3, 3] = place
    return matrix


def recorded(tmp_path, frames, detect, fingers):
    """Write frames through a camera's stream as the recorder does; return the file."""
    bench = rig_document()
    bench["cameras"] = {"front": {"driver": "opencv_camera", "source": 0, "intrinsics": VIEW}}
    head = header()
    head.rig.update(bench, fingers=fingers) if fingers else head.rig.update(bench)
    names = tuple(fingers["fingers"]) if fingers else ()
    writer = EpisodeWriter(tmp_path / "episode-000000.mcap", head, Clock(T0, 0, 1.0), ("front",), names)
    stream = CameraStream("front", bench["cameras"]["front"], detect, fingers)
    for frame in frames:
        stream.take(frame, frame.arrival_ns - 1_000_000, writer)
        stream.collect(30.0)
    return writer.close(True)


def test_fingertips_are_recorded_beside_the_images(tmp_path):
    places = {"thumb": pose((-0.05, 0.02, 0.4), (190, 12, 4)), "index": pose((0.05, -0.02, 0.38), (172, -9, 30))}
    cubes = [(places[name], FINGERS["fingers"][name]["cube"]) for name in NAMES]
    both = render_scene(cubes, VIEW, np.random.default_rng(0), Look())
    one = render_scene(cubes[:1], VIEW, np.random.default_rng(1), Look())
    images = [ImageFrame(T0 + k * 33_000_000, k, image) for k, image in enumerate((both, both, one))]
    episode = read_recording(recorded(tmp_path, images, at_once, FINGERS)).episode
    streams = {stream.finger: stream for stream in episode.fingers}
    assert set(streams) == set(NAMES) and episode.tags == ()
    assert (streams["thumb"].faces > 0).all()
    np.testing.assert_array_equal(streams["index"].faces > 0, [True, True, False])
    assert np.isnan(streams["index"].position[2]).all()
    known = fingers_of(FINGERS)
    for name, stream in streams.items():
        truth = places[name] @ known[name].tip
        assert 1000 * np.linalg.norm(stream.position[0] - truth[:3, 3]) < 0.5
        turn = Rotation.from_quat(stream.quaternion[0]).inv() * Rotation.from_matrix(truth[:3, :3])
        assert np.degrees(turn.magnitude()) < 0.5
        assert set(stream.ids[0]) <= set(known[name].cube.ids.values()) and stream.ids[0]
        spread = 1000 * np.sqrt(np.diag(stream.covariance[0])[3:])
        assert (0 < spread).all() and (spread < 1.0).all()
        assert not stream.ambiguous[0]


def test_a_finger_that_is_never_seen_is_named(tmp_path):
    image = np.full((540, 960), 128, np.uint8)
    frames = [ImageFrame(T0 + k * 33_000_000, k, image) for k in range(4)]
    report = check(recorded(tmp_path, frames, at_once, FINGERS))
    words = [f.text for f in report.findings if f.stream == "camera front"]
    assert "no tag of thumb in view in any image" in words and "no tag of index in view in any image" in words


def test_a_cameras_own_jpeg_is_kept_as_it_came(tmp_path):
    image = np.random.default_rng(0).integers(0, 255, (540, 960), np.uint8)
    own = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 40])[1].tobytes()
    frames = [ImageFrame(T0, 0, image, own, 77_000_000), ImageFrame(T0 + 33_000_000, 1, image)]
    path = recorded(tmp_path, frames, None, None)
    kept = [m.data for m in read_records(path, images=True).of_topic("/camera/front/image")]
    assert own in kept[0] and own not in kept[1]
    np.testing.assert_array_equal(read_recording(path).cameras["front"].device_ns, [77_000_000, -1])


def test_the_process_searches_for_fingers_too():
    image = np.full((540, 960), 128, np.uint8)
    with in_background(look) as detect:
        view = detect(image, VIEW, FINGERS, None).result(timeout=60)
    assert view.tips == {} and view.cubes == {}


def test_fingers_stand_in_the_rig_file_or_beside_it(tmp_path):
    (tmp_path / "fingers.json").write_text(json.dumps(FINGERS))
    (tmp_path / "rig.json").write_text(json.dumps({**rig_document(), "fingers": "fingers.json"}))
    rig = read_rig(tmp_path / "rig.json")
    assert rig.fingers == FINGERS and rig.document["fingers"] == FINGERS
    assert rig_file.from_document(rig_document(fingers=FINGERS), "bench").fingers == FINGERS
    assert rig_file.from_document(rig_document(), "bench").fingers is None
    with pytest.raises(FormatError, match="fingers"):
        rig_file.from_document(rig_document(fingers={"version": "1.0", "fingers": {}}), "bench")


class TimedEye(Eye):
    """Has a clock of its own, and loses an image now and then."""

    @property
    def counts(self):
        return StreamCounts(received=self._next, lost=2, notes=["rate 60 asked, 30 given"])

    def read(self, timeout):
        return [replace(f, device_ns=5_000_000_000 + 100_000_000 * f.sequence) for f in super().read(timeout)]


def test_a_camera_with_a_clock_is_timed_by_it_and_its_losses_are_kept(tmp_path):
    clock = Clock.start(4.0)
    cnc = Controller(clock)
    devices = RigDevices(cnc, Board(clock, cnc), {"side": TimedEye(clock)})
    bench = replace(rig(camera=True), clock=clock)
    session = Recorder(
        bench, SENSOR, plan(1, hold=0.3, rest=0.4), tmp_path / "session", devices=devices, mount=lambda press: None
    ).run(lambda summary: True)
    recording = read_recording(session.episodes[0])
    assert recording.clocks["camera side"].axis == "device_ns"
    own = recording.cameras["side"].device_ns
    assert (np.diff(own) == 100_000_000).all() and len(own) > 10
    assert np.diff(recording.cameras["side"].sample_ns) == pytest.approx(100_000_000, rel=0.02)
    counts = recording.counts["camera side"]
    assert counts["received"] >= len(own) and counts["lost"] == 0, "what was lost before is not this recording's"
    assert counts["notes"] == ["rate 60 asked, 30 given"], "what a camera does not do holds for every recording"
