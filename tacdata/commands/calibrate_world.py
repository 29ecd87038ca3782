"""Estimate the pose of a camera in the world."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import RECORD, Result
from tacdata.errors import UsageError
from tacdata.progress import say

if TYPE_CHECKING:
    from tacdata.demonstrations.camera_world import CameraWorld

ORDER = 80
PANEL = RECORD
EXAMPLES = (
    "tacdata calibrate-world --pairs pairs.yaml --out eye.yaml",
    "tacdata calibrate-world --board board.yaml --images views --calibration camera.yaml --out world.yaml",
    "tacdata calibrate-world --pairs pairs.yaml --camera left --out left.yaml",
)


def run(
    out: Annotated[Path, typer.Option(help="File to write (YAML); a demo rig names it as the camera's world.")],
    pairs: Annotated[
        Path | None, typer.Option(help="Poses of a robot's gripper with a tag cube, and the cube as seen (YAML).")
    ] = None,
    board: Annotated[Path | None, typer.Option(help="Board file (YAML) of a ChArUco board that is the world.")] = None,
    images: Annotated[
        Path | None, typer.Option(help="With --board: folder of images of it, board and camera at rest.")
    ] = None,
    calibration: Annotated[
        Path | None, typer.Option(help="With --board: what tacdata calibrate-camera wrote for this camera.")
    ] = None,
    camera: Annotated[str, typer.Option(help="With --board: name of the camera in the demo rig.")] = "camera",
    frame: Annotated[str, typer.Option(help="With --board: name of the world.")] = "board",
) -> Result:
    """Estimate the pose of a camera: by a robot that carries a tag cube (hand-eye), or by a board on the table."""
    import numpy as np

    from tacdata import documents

    if out.exists():
        raise UsageError(f"{out} exists", "a new file; calibrations are not overwritten", "choose another --out")
    if pairs is not None:
        from tacdata.demonstrations.camera_pose.hand_eye_pairs import solve_pairs

        solution = solve_pairs(pairs)
    elif board is not None and images is not None and calibration is not None:
        solution = _by_board(board, images, calibration, camera, frame)
    else:
        fault = "neither --pairs nor --board with --images and --calibration"
        raise UsageError(fault, "one of them", "see tacdata calibrate-world --help")
    document = solution.document(datetime.now(UTC).isoformat(timespec="seconds"))
    documents.write(out, document, "camera_world")
    x, y, z = solution.matrix[:3, 3]
    place, turn = solution.residual
    print(f"camera {solution.camera} is at {x:.4f}, {y:.4f}, {z:.4f} m in {solution.frame!r} ({solution.method})")
    print(f"{solution.poses} poses leave {1000 * place:.2f} mm and {np.degrees(turn):.3f} deg (root mean square)")
    if solution.spread:
        print(f"it is known to {1000 * solution.spread[0]:.2f} mm and {np.degrees(solution.spread[1]):.3f} deg")
    for remark in solution.remarks:
        print(f"note: {remark}")
    print(f"written to {out}")
    say(f"next: put  world: {out.name}  into the camera's entry of the demo rig file")
    return Result(document)


def _by_board(board: Path, images: Path, calibration: Path, camera: str, frame: str) -> CameraWorld:
    from tacdata import documents
    from tacdata.demonstrations.camera_pose.board_pose import board_poses
    from tacdata.demonstrations.camera_pose.hand_eye import board_world
    from tacdata.tags.board import read_board
    from tacdata.tags.calibration.view_picker import images_of

    intrinsics = documents.read(calibration, "camera_calibration")["intrinsics"]
    layout = read_board(board)
    poses, rms, spread = board_poses(images_of(images), layout, intrinsics)
    return replace(board_world(camera, frame, poses, rms, spread), board=layout.document)
