"""Where a camera stands: by a robot with a cube, and by a board."""

import cv2
import numpy as np
import pytest
import yaml
from running.in_process import tacdata
from scipy.spatial.transform import Rotation

from tacdata.demonstrations.camera_pose.board_pose import board_poses
from tacdata.demonstrations.camera_pose.hand_eye import board_world, hand_eye
from tacdata.demonstrations.camera_pose.hand_eye_pairs import solve_pairs
from tacdata.demonstrations.camera_world import CameraWorld
from tacdata.errors import FormatError, UsageError
from tacdata.tags.board import Board, draw_squares
from tacdata.virtual_rig.optics.render import render_cube
from tacdata.virtual_rig.optics.sheet import render_sheet


def pose(turn, place):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = Rotation.from_rotvec(turn).as_matrix(), place
    return matrix


CAMERA, HELD = pose([0.3, 2.0, 0.4], [0.5, 0.2, 0.7]), pose([0.1, 0.2, -0.5], [0.02, 0.01, 0.08])


def pairs(count=15, seed=0, noise=(0.002, 0.0003)):
    rng = np.random.default_rng(seed)
    grippers = np.array([pose(rng.normal(0, 0.6, 3), rng.normal((0.4, 0, 0.3), 0.1)) for _ in range(count)])
    shake = [pose(rng.normal(0, noise[0], 3), rng.normal(0, noise[1], 3)) for _ in range(count)]
    return grippers, np.array([np.linalg.inv(CAMERA) @ g @ HELD @ s for g, s in zip(grippers, shake, strict=True)])


def off(found, truth):
    turn = Rotation.from_matrix(found[:3, :3] @ truth[:3, :3].T).magnitude()
    return np.linalg.norm(found[:3, 3] - truth[:3, 3]), turn


def test_exact_pairs_give_the_camera_exactly():
    found = hand_eye("c", "base", *pairs(noise=(0.0, 0.0)))
    assert off(found.matrix, CAMERA) == pytest.approx((0, 0), abs=1e-6)
    assert found.cube is not None and off(found.cube, HELD) == pytest.approx((0, 0), abs=1e-6)


def test_noise_is_averaged_and_the_uncertainty_fits_the_error():
    ratios = []
    for seed in range(6):
        found = hand_eye("c", "base", *pairs(seed=seed))
        place, turn = off(found.matrix, CAMERA)
        assert place < 0.0015 and turn < 0.003 and found.spread is not None
        ratios.append(place / found.spread[0])
    assert 0.2 < np.mean(ratios) < 2.5


def test_a_wrong_pair_is_left_out_and_named():
    grippers, cubes = pairs()
    cubes[4] = cubes[4] @ pose([1.0, 0, 0], [0, 0, 0])
    found = hand_eye("c", "base", grippers, cubes)
    assert "pairs 4" in found.remarks[0] and found.poses == 14
    assert off(found.matrix, CAMERA)[0] < 0.0015


def test_what_cannot_be_determined_is_refused():
    with pytest.raises(UsageError, match="three or more"):
        hand_eye("c", "base", *(part[:2] for part in pairs()))
    grippers = np.array([pose([0, 0, 0.2 * k], [0.1 * k, 0, 0]) for k in range(8)])
    with pytest.raises(UsageError, match="second axis"):
        hand_eye("c", "base", grippers, grippers)
    grippers, cubes = pairs()
    with pytest.raises(FormatError, match="order of the pairs"):
        hand_eye("c", "base", grippers, cubes[::-1])


def flat(matrix):
    return {"position": matrix[:3, 3].tolist(), "quaternion": Rotation.from_matrix(matrix[:3, :3]).as_quat().tolist()}


def test_a_file_of_pairs_gives_a_file_of_the_camera(tmp_path):
    entries = [{"gripper": flat(g), "cube": flat(c)} for g, c in zip(*pairs(), strict=True)]
    path = tmp_path / "pairs.yaml"
    path.write_text(yaml.safe_dump({"version": "1.0", "camera": "side", "frame": "base", "pairs": entries}))
    found = solve_pairs(path)
    again = CameraWorld.from_document(found.document("2026-01-01"), "file")
    assert np.allclose(again.matrix, found.matrix) and again.camera == "side" and again.spread == found.spread
    entries[0]["gripper"]["quaternion"] = [0, 0, 0, 2]
    path.write_text(yaml.safe_dump({"version": "1.0", "camera": "side", "frame": "base", "pairs": entries}))
    with pytest.raises(FormatError, match="length 2"):
        solve_pairs(path)
    entries = [{"gripper": entries[1]["gripper"], "image": "a.png"}] * 3
    path.write_text(yaml.safe_dump({"version": "1.0", "camera": "s", "frame": "b", "pairs": entries}))
    with pytest.raises(FormatError, match="intrinsics and tag_cube"):
        solve_pairs(path)


def test_a_board_on_the_table_gives_the_camera():
    board, truth = Board(9, 6, 25.0, 18.0, "4X4_50"), pose([0.5, 0.3, 0.1], [-0.1, -0.08, 0.45])
    intrinsics = {"width": 640, "height": 480, "fx": 605.0, "fy": 602.0, "cx": 320.0, "cy": 240.0}
    sheet = np.pad(draw_squares(board, 40), 40, constant_values=255)
    corner = truth @ pose([0, 0, 0], [-0.025, -0.025, 0])  # the sheet has a margin of one square
    images = [(str(k), render_sheet(sheet, 0.275, corner, intrinsics, np.random.default_rng(k))) for k in range(3)]
    poses, rms, spread = board_poses(images, board, intrinsics)
    found = board_world("c", "board", poses, rms, spread)
    place, turn = off(found.matrix, np.linalg.inv(truth))
    assert place < 0.002 and turn < 0.004 and found.poses == 3 and not found.remarks
    assert 1e-5 < spread < 0.003 and rms < 0.0003
    moved = poses[1].copy()
    moved[:3, 3] += [0.0, 0.28, 0.0]
    with pytest.raises(FormatError, match=r"image 2 of 3: 280 mm"):
        board_world("c", "board", [poses[0], moved, poses[2]], rms, spread)
    nudged = poses[1].copy()
    nudged[:3, 3] += [0.0, 0.003, 0.0]
    shaken = board_world("c", "board", [poses[0], nudged, poses[2]], rms, spread)
    (words,) = shaken.remarks
    assert words.startswith("the board in image 2 of 3 stands 3.") and "was pushed" in words
    assert found.spread and shaken.spread and shaken.spread[0] > 0.001 > 2 * found.spread[0]
    with pytest.raises(UsageError, match="no image shows the board"):
        board_poses([("empty", np.full((480, 640), 90, np.uint8))], board, intrinsics)


def run(*arguments):
    return tacdata("calibrate-world", *arguments)


def test_images_of_a_robot_that_carries_a_cube_give_a_file_that_a_demo_rig_takes(tmp_path):
    cube = {"side": 20.0, "tag": 16.0, "ids": {"+x": 0, "-x": 1, "+y": 2, "-y": 3, "+z": 4}}
    intrinsics = {"width": 640, "height": 480, "fx": 700.0, "fy": 700.0, "cx": 319.5, "cy": 239.5}
    eye, rng, entries = pose([0.0, 0.0, 0.3], [0.3, -0.1, 0.1]), np.random.default_rng(1), []
    for k in range(10):
        seen = pose(np.array([2.4, 1.0, 0.2]) + rng.normal(0, 0.35, 3), [*rng.uniform(-0.05, 0.05, 2), 0.3])
        cv2.imwrite(str(tmp_path / f"{k}.png"), render_cube(seen, intrinsics, cube, rng))
        entries.append({"gripper": flat(eye @ seen @ np.linalg.inv(HELD)), "image": f"{k}.png"})
    document = {"version": "1.0", "camera": "eye", "frame": "base", "intrinsics": intrinsics, "tag_cube": cube}
    (tmp_path / "pairs.yaml").write_text(yaml.safe_dump({**document, "pairs": entries}))
    out = tmp_path / "world.yaml"
    assert "camera eye is at 0.30" in run("--pairs", tmp_path / "pairs.yaml", "--out", out).stdout
    found = CameraWorld.from_document(yaml.safe_load(out.read_text()), "world.yaml")
    place, turn = off(found.matrix, eye)
    assert place < 0.001 and turn < 0.004 and found.poses >= 8
    again = run("--pairs", tmp_path / "pairs.yaml", "--out", out)
    assert again.returncode == 2 and "calibrations are not overwritten" in again.stderr
    assert run("--out", tmp_path / "new.yaml").returncode == 2
    assert run("--pairs", tmp_path / "none.yaml", "--out", tmp_path / "new.yaml").returncode == 2
    assert not (tmp_path / "new.yaml").exists()


def test_images_of_a_board_give_it_too(tmp_path):
    board, truth = Board(9, 6, 25.0, 18.0, "4X4_50"), pose([0.5, 0.3, 0.1], [-0.1, -0.08, 0.45])
    intrinsics = {"width": 640, "height": 480, "fx": 605.0, "fy": 602.0, "cx": 320.0, "cy": 240.0, "distortion": []}
    sheet = np.pad(draw_squares(board, 40), 40, constant_values=255)
    corner = truth @ pose([0, 0, 0], [-0.025, -0.025, 0])
    (tmp_path / "views").mkdir()
    for k in range(3):
        drawn = render_sheet(sheet, 0.275, corner, intrinsics, np.random.default_rng(k))
        cv2.imwrite(str(tmp_path / "views" / f"{k}.png"), drawn)
    (tmp_path / "board.yaml").write_text(yaml.safe_dump({"version": "1.0", **board.document}))
    found = {
        "version": "1.0",
        "date": "2026-01-01",
        "code_version": "0",
        "source": "a test",
        "model": "k1k2p1p2",
        "intrinsics": intrinsics,
        "uncertainty": dict.fromkeys(("fx", "fy", "cx", "cy"), 1.0),
        "rms": 0.1,
        "held_out_rms": 0.1,
        "coverage": 1.0,
        "tilt": 40.0,
        "board": {},
        "views": [],
    }
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(found))
    files = {"board": "board.yaml", "calibration": "camera.yaml", "out": "eye.yaml"}
    given = [word for option, file in files.items() for word in (f"--{option}", tmp_path / file)]
    assert run(*given, "--images", tmp_path / "none").returncode == 2
    done = run(*given, "--images", tmp_path / "views", "--camera", "eye")
    assert done.returncode == 0, done.stderr
    assert "put  world: eye.yaml  into the camera's entry" in done.stdout
    world = CameraWorld.from_document(yaml.safe_load((tmp_path / "eye.yaml").read_text()), "eye")
    place, turn = off(world.matrix, np.linalg.inv(truth))
    assert world.board == board.document, "so that a rig refuses cameras of different boards"
    assert world.camera == "eye" and place < 0.002 and turn < 0.004
