"""The rig as a whole: files, wires, the mounting file, the camera."""

import numpy as np
import pytest
import trimesh
import yaml

from tacdata import documents
from tacdata.clock import Clock
from tacdata.devices.device import Camera, MotionController, TaxelBoard, create
from tacdata.errors import DeviceError, UsageError
from tacdata.indenters import from_document
from tacdata.rig import read_rig
from tacdata.sensor import Sensor, default_sensor
from tacdata.virtual_rig import mount
from tacdata.virtual_rig.optics.scene import CUBE, INTRINSICS, draw_scene
from tacdata.virtual_rig.rig import NOMINAL, VirtualRig, board_format, running
from tacdata.virtual_rig.world.lower_face import LowerFace
from tacdata.virtual_rig.world.mounting import Mounted

SPHERE = {"shape": "sphere", "radius": 4.0}


def test_press_reaches_the_board_through_the_wires(tmp_path):
    with running(tmp_path, speed=10.0, seed=2, camera=False) as path:
        rig = read_rig(path)
        assert rig.clock.rate == 10.0
        assert rig.cameras == {}
        assert rig.envelope.contains(rig.registration.to_machine(0, 0, 2.5))
        cnc = create(rig.cnc, MotionController, rig.clock)
        board = create(rig.board, TaxelBoard, rig.clock)
        with cnc, board:
            mount(rig.document, SPHERE)
            cnc.move(rig.registration.to_machine(0.95, 1.25, -2.0), 25.0)
            cnc.wait_idle(20)
            idle = np.mean([f.counts for f in board.read(0.5)], axis=0)
            cnc.move(rig.registration.to_machine(0.95, 1.25, 1.2), 4.0)
            cnc.dwell(1.0)
            cnc.move(rig.registration.to_machine(0.95, 1.25, -2.0), 4.0)
            cnc.wait_idle(20)
            cnc.dwell(1.0)
            until, frames = rig.clock.now_ns(), []
            while not frames or frames[-1].arrival_ns < until:  # a busy machine delivers late
                frames += board.read(0.5)
            pressed = np.max([f.counts for f in frames], axis=0)
            after = np.mean([f.counts for f in frames[-8:]], axis=0)
            counts = board.counts
    truth = documents.read(tmp_path / "truth.yaml", "virtual_truth")
    response = (pressed - idle) / np.array(truth["world"]["gain"])
    assert np.argmax(response) == 3 + 6 * 2
    assert response.max() > 0.3
    assert np.abs(after - idle).max() < 60
    assert (counts.lost, counts.corrupt) == (0, 0)
    assert not path.exists(), "the ports are gone, and so is the file that names them"


def test_rig_file_holds_no_truth(tmp_path):
    with running(tmp_path, camera=False, seed=4) as path:
        text = path.read_text()
        truth = yaml.safe_load((tmp_path / "truth.yaml").read_text())
    said = yaml.safe_load(text)["registration"]
    assert said["origin"] == list(NOMINAL.origin)
    assert truth["world"]["registration"]["origin"] != said["origin"]
    assert str(truth["world"]["gain"][0]) not in text


def test_one_rig_a_directory_and_no_foreign_file_overwritten(tmp_path):
    second = VirtualRig(tmp_path, camera=False)
    with running(tmp_path, camera=False) as path:
        with pytest.raises(UsageError, match="is running"):
            second.start()
        second.stop()
        assert path.exists(), "the loser leaves the winner's file alone"
    foreign = tmp_path / "lab"
    with running(foreign, camera=False) as path:
        document = yaml.safe_load(path.read_text())
    path.write_text(yaml.safe_dump({**document, "name": "real rig"}))
    third = VirtualRig(foreign, camera=False)
    with pytest.raises(UsageError, match="another rig"):
        third.start()
    third.stop()
    assert yaml.safe_load(path.read_text())["name"] == "real rig"


def test_speed_must_be_possible(tmp_path):
    with pytest.raises(UsageError, match="speed 0"):
        VirtualRig(tmp_path, speed=0.0)


def test_mounting(tmp_path):
    mounted = Mounted(tmp_path / "mounted.json")
    mounted.look()
    assert mounted.indenter is None
    mount(tmp_path, SPHERE, 30.0)
    mounted.look()
    assert mounted.indenter is not None
    assert (mounted.indenter.document, mounted.yaw) == (SPHERE, 30.0)
    mount({"mounting": {"file": str(tmp_path / "mounted.json")}}, {"shape": "sphere", "radius": 2.0})
    mounted.look()
    assert mounted.indenter.document["radius"] == 2.0
    with pytest.raises(UsageError, match="no mounting file"):
        mount({"name": "real"}, SPHERE)


def test_a_solid_from_a_file_is_in_place_when_mounting_returns(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=4, radius=2.0)
    ball.apply_translation([0, 0, 7.5])
    ball.export(tmp_path / "ball.stl")
    solid = from_document({"shape": "mesh", "file": "ball.stl"}, "plan", tmp_path)
    with running(tmp_path / "rig", speed=1.0, camera=False) as path:
        mount(read_rig(path).document, solid.document)
        assert (tmp_path / "rig" / "mounted.taken").exists()
    assert not (tmp_path / "rig" / "mounted.taken").exists()
    lowest = LowerFace.upright(solid)
    x, y = np.random.default_rng(0).uniform(-1.9, 1.9, (2, 400))
    x, y = x[x**2 + y**2 < 1.7**2], y[x**2 + y**2 < 1.7**2]
    np.testing.assert_allclose(lowest.profile(x, y), 2 - np.sqrt(4 - x**2 - y**2), atol=0.02)
    assert (lowest.profile(np.array([2.5, 0.0]), np.array([0.0, -9.0])) >= 100).all()


def test_another_sensor_gives_another_board(tmp_path):
    document = default_sensor().document
    document["taxels"].update(columns=4, rows=3, rate=1000.0)
    sensor = Sensor.from_document(document, "test")
    layout = board_format(sensor)
    assert (layout.channels, layout.rate, layout.size) == (12, 1000.0, 2 + 2 + 24 + 2)
    rig = VirtualRig(tmp_path, 1.0, camera=False, sensor=sensor)
    assert rig.board.baud == 460800
    assert rig.document["board"]["format"]["channels"]["count"] == 12
    rig.stop()


def test_cube_is_in_the_picture_wherever_the_carriage_may_be(tmp_path):
    rig = VirtualRig(tmp_path, 1.0, camera=False)
    envelope = rig.document["envelope"]
    rig.stop()
    for seed in range(5):
        scene = draw_scene(seed, NOMINAL.to_machine(0, 0, 0))
        corners = np.array(np.meshgrid(*zip(envelope["min"], envelope["max"], strict=True))).reshape(3, -1).T
        for corner in corners:
            x, y, z = scene.camera_cube(corner)[:3, 3]
            u, v = INTRINSICS["fx"] * x / z + INTRINSICS["cx"], INTRINSICS["fy"] * y / z + INTRINSICS["cy"]
            margin = INTRINSICS["fx"] * CUBE["side"] / 1000 / z
            assert margin < u < INTRINSICS["width"] - margin
            assert margin < v < INTRINSICS["height"] - margin
        rotation = scene.camera_cube(corners[0])[:3, :3]
        assert np.allclose(rotation @ rotation.T, np.eye(3))
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        assert scene.camera_cube(corners[0])[1, 3] < scene.camera_cube(corners[0] - (0, 0, 20))[1, 3]  # up is up


def test_camera_shows_the_cube_over_http(tmp_path):
    rig = VirtualRig(tmp_path, speed=2.0, seed=1)
    rig.start()
    try:
        entry = rig.document["cameras"]["side"]
        with create(entry, Camera, rig.clock) as camera:
            images = []
            while len(images) < 4:
                images += camera.read(1.0)
    finally:
        rig.stop()
    assert [i.sequence for i in images] == list(range(len(images)))
    assert images[0].image.shape[:2] == (480, 640)
    middle = images[-1].image[150:330, 230:410]
    assert middle.min() < 60
    assert middle.max() > 150


def test_stalled_camera_is_said(tmp_path):
    rig = VirtualRig(tmp_path, speed=8.0, seed=1)
    rig.start()
    try:
        with create(rig.document["cameras"]["side"], Camera, rig.clock) as camera:
            camera.read(0.5)
            assert rig.camera is not None
            rig.camera.inject_stall()
            with pytest.raises(DeviceError, match="stalled"):
                for _ in range(200):
                    camera.read(1.0)
    finally:
        rig.stop()


def test_clock_is_shared_by_its_three_numbers(tmp_path):
    with running(tmp_path, speed=5.0, camera=False) as path:
        clock = read_rig(path).clock
        other = Clock(clock.epoch_ns, clock.origin_ns, clock.rate)
        assert abs(other.now_ns() - clock.now_ns()) < 1e9
