"""Estimates the pose of a camera: by a robot that carries a tag cube, or by a board at the world's origin.

Hand-eye calibration: gripper_i X = Y cube_i. Unknown are the cube in the gripper X and the camera in the robot's base Y
(F. Dornaika and R. Horaud, IEEE Trans. Robotics and Automation 14 (1998) 617: robot-world, hand-eye). OpenCV's closed
form (`cv2.calibrateRobotWorldHandEye`) gives the start. Least squares over all pairs follows, rotations and positions
weighted by the uncertainty of a tag pose.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata.demonstrations.camera_world import CameraWorld
from tacdata.demonstrations.paths.motion_filter import exponential, logarithm
from tacdata.errors import FormatError, UsageError

WEIGHTS = 0.0003, float(np.radians(0.2))
"""Standard deviation of a tag cube's position [m] and rotation [rad], which weights the residuals."""
LEAST_TURN = np.radians(15.0)
"""Minimum rotation of the gripper about two axes [rad]; with less the solution is not determined."""
MOVED, TURNED = 0.02, float(np.radians(3.0))
"""Largest difference between images of a board at rest: share of the camera's distance [1], and angle [rad]."""
NUDGED = 0.003
"""Difference between images of a board from which it is reported, as a share of the camera's distance [1]."""
OUTLYING = 5.0
"""A pair is an outlier if its residual is this many times the median [1]."""


def hand_eye(camera: str, frame: str, grippers: np.ndarray, cubes: np.ndarray) -> CameraWorld:
    """Return the pose of a camera in a robot's base.

    Args:
        camera: Name of the camera.
        frame: Name of the base's frame.
        grippers: Gripper in the base, shape (n, 4, 4) [m].
        cubes: Cube in the camera at the same moments, shape (n, 4, 4) [m].

    Raises:
        UsageError: If there are fewer than three pairs, or the gripper hardly turned.
        FormatError: If the pairs contradict each other altogether.
    """
    if len(grippers) != len(cubes) or len(grippers) < 3:
        fault = f"{len(grippers)} gripper and {len(cubes)} cube poses"
        allowed = "the same number of both, three or more"
        raise UsageError(fault, allowed, "take ten or more, with rotations about all axes")
    _check_turns(grippers)
    inliers, remarks = np.ones(len(grippers), bool), []
    # Outliers are left out and the fit is repeated, until the set of pairs no longer changes.
    for _ in range(3):
        base, mount = _refined(*_begun(grippers[inliers], cubes[inliers]), grippers[inliers], cubes[inliers])
        deviation = np.linalg.norm(_residuals(base, mount, grippers, cubes).reshape(-1, 6), axis=1)
        good = deviation <= OUTLYING * max(float(np.median(deviation)), 1.0)
        if good.sum() < 3 or np.array_equal(good, inliers):
            break
        inliers = good
    left_out = np.flatnonzero(~inliers)
    if len(left_out):
        remarks.append(f"pairs {', '.join(map(str, left_out))} contradict the others and were left out")
    # Over their weights the residuals were fitted; in radians and metres they are judged.
    raw = _residuals(base, mount, grippers[inliers], cubes[inliers]).reshape(-1, 6) * np.repeat(WEIGHTS[::-1], 3)
    turn, place = (float(np.sqrt((raw[:, part] ** 2).sum(axis=1).mean())) for part in (slice(0, 3), slice(3, 6)))
    if place > 0.02 or turn > 0.1:
        raise FormatError(
            f"hand-eye pairs with residuals of {1000 * place:.1f} mm and {np.degrees(turn):.1f} deg",
            "pairs of the same moments",
            "check the order of the pairs, the units (metres), xyzw, and that the cube sits firmly on the gripper",
        )
    spread = _spread(base, mount, grippers[inliers], cubes[inliers])
    method = "hand-eye (calibrateRobotWorldHandEye, then least squares)"
    return CameraWorld(camera, frame, base, method, int(inliers.sum()), (place, turn), spread, mount, tuple(remarks))


def board_world(camera: str, frame: str, poses: Sequence[np.ndarray], rms: float, spread: float) -> CameraWorld:
    """Return the pose of a camera in the frame of a board, from the board's pose in one or more images.

    Args:
        camera: Name of the camera.
        frame: Name of the board's frame.
        poses: Board in the camera, shape (4, 4) [m], one per image; the board and the camera were at rest.
        rms: Reprojection error at the board [m], root mean square.
        spread: Standard uncertainty of the camera's position from one image [m].

    Raises:
        FormatError: If the board's pose differs between images: it, or the camera, moved.
    """
    from scipy.spatial.transform import Rotation

    inverse = np.array([np.linalg.inv(pose) for pose in poses])
    mean = np.eye(4)
    rotations = Rotation.from_matrix(inverse[:, :3, :3])
    # The board is at rest, so the poses of all images are one pose with noise.
    mean[:3, :3], mean[:3, 3] = rotations.mean().as_matrix(), inverse[:, :3, 3].mean(axis=0)
    turns = (rotations * Rotation.from_matrix(mean[:3, :3]).inv()).magnitude()  # ty: ignore[missing-union-attribute]
    distance = max(float(np.linalg.norm(mean[:3, 3])), 0.1)
    places = np.array([pose[:3, 3] for pose in poses])
    offset = np.linalg.norm(places - np.median(places, axis=0), axis=1)
    if offset.max() > max(MOVED * distance, OUTLYING * spread) or turns.max() > TURNED:
        worst = int(np.argmax(offset / (MOVED * distance) + turns / TURNED))
        raise FormatError(
            f"the board in image {worst + 1} of {len(poses)}: {1000 * offset[worst]:.0f} mm and "
            f"{np.degrees(turns[worst]):.1f} deg from where it stands in the others",
            "images of a board and a camera that both rest",
            "leave that image out if the board was put elsewhere, or take the images again",
        )
    remarks = () if turns.max() < 0.01 else (f"the images differ by up to {np.degrees(turns.max()):.1f} deg: it moved",)
    if offset.max() > max(NUDGED * distance, OUTLYING * float(np.median(offset))):
        remarks += (
            f"the board in image {int(np.argmax(offset)) + 1} of {len(poses)} stands {1000 * offset.max():.1f} mm from "
            "where it stands in the others: it or the camera was pushed; leave that image out, or take them all again",
        )
    # The scatter between images counts in the uncertainty as well as the uncertainty of a single image.
    once = max(spread, float(np.sqrt((offset**2).mean())))
    uncertainty = (
        once / np.sqrt(len(poses)),
        max(once / distance, float(np.sqrt((turns**2).mean()))) / np.sqrt(len(poses)),
    )
    residual = rms, float(np.sqrt((turns**2).mean()))
    return CameraWorld(camera, frame, mean, "board", len(poses), residual, uncertainty, None, remarks)


def _check_turns(grippers: np.ndarray) -> None:
    from scipy.spatial.transform import Rotation

    # With turns about one axis alone, the place along that axis is not determined (Tsai and Lenz 1989).
    turns = (Rotation.from_matrix(grippers[1:, :3, :3]) * Rotation.from_matrix(grippers[0, :3, :3]).inv()).as_rotvec()  # ty: ignore[missing-union-attribute]
    about = np.linalg.svd(turns, compute_uv=False)
    if len(about) < 2 or np.abs(turns).max() < LEAST_TURN or about[1] < LEAST_TURN:
        raise UsageError(
            f"a gripper that rotated by {np.degrees(np.linalg.norm(turns, axis=1).max()):.0f} deg, and by "
            f"{np.degrees(about[1] if len(about) > 1 else 0):.0f} deg about a second axis",
            f"{np.degrees(LEAST_TURN):.0f} deg or more about two axes",
            "add poses that are rotated about all axes",
        )


def _begun(grippers: np.ndarray, cubes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return camera in base and cube in gripper, shapes (4, 4) [m], by OpenCV's closed form."""
    import cv2

    # OpenCV assumes a camera on the gripper: its world is our cube, its base our gripper, its gripper our base.
    solution = cv2.calibrateRobotWorldHandEye(
        list(cubes[:, :3, :3]), list(cubes[:, :3, 3]), list(grippers[:, :3, :3]), list(grippers[:, :3, 3])
    )
    cube_gripper, camera_base = np.eye(4), np.eye(4)
    cube_gripper[:3, :3], cube_gripper[:3, 3] = solution[0], np.ravel(solution[1])
    camera_base[:3, :3], camera_base[:3, 3] = solution[2], np.ravel(solution[3])
    return np.linalg.inv(camera_base), np.linalg.inv(cube_gripper)


def _refined(
    base: np.ndarray, mount: np.ndarray, grippers: np.ndarray, cubes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    from scipy.optimize import least_squares

    def moved(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _nudged(base, x[:6]), _nudged(mount, x[6:])

    # Robust loss against a single wrong pair: residuals beyond two standard deviations count linearly.
    fit = least_squares(lambda x: _residuals(*moved(x), grippers, cubes), np.zeros(12), loss="soft_l1", f_scale=2.0)
    return moved(fit.x)


def _spread(base: np.ndarray, mount: np.ndarray, grippers: np.ndarray, cubes: np.ndarray) -> tuple[float, float]:
    """Return the standard uncertainty of the camera's position [m] and rotation [rad], from the residuals."""
    start, step = _residuals(base, mount, grippers, cubes), 1e-6
    jacobian = np.empty((len(start), 12))
    for k in range(12):
        x = step * np.eye(12)[k]
        jacobian[:, k] = (_residuals(_nudged(base, x[:6]), _nudged(mount, x[6:]), grippers, cubes) - start) / step
    # Two poses of six numbers each were fitted.
    variance = float(start @ start) / max(len(start) - 12, 1)
    # A pseudo-inverse: turns about almost one axis leave a direction undetermined.
    covariance = variance * np.linalg.pinv(jacobian.T @ jacobian)
    return float(np.sqrt(np.trace(covariance[3:6, 3:6]))), float(np.sqrt(np.trace(covariance[:3, :3])))


def _nudged(pose: np.ndarray, x: np.ndarray) -> np.ndarray:
    variant = pose.copy()
    variant[:3, :3], variant[:3, 3] = exponential(x[:3]) @ pose[:3, :3], pose[:3, 3] + x[3:]
    return variant


def _residuals(base: np.ndarray, mount: np.ndarray, grippers: np.ndarray, cubes: np.ndarray) -> np.ndarray:
    """Return rotation and translation residuals of each pair over `WEIGHTS` [1], shape (6 n,)."""
    rows = []
    for expected, observed in zip(grippers @ mount, base @ cubes, strict=True):
        rows += [
            logarithm(expected[:3, :3] @ observed[:3, :3].T) / WEIGHTS[1],
            (expected[:3, 3] - observed[:3, 3]) / WEIGHTS[0],
        ]
    return np.concatenate(rows)
