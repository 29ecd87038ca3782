"""Joint values for a robot's URDF, by inverse kinematics; unreachable targets are NaN and named, never clipped."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tacdata import documents, provenance, schemas
from tacdata.errors import FormatError, UsageError
from tacdata.exporters.exporter import Exporter, new_folder
from tacdata.replacement import replacement
from tacdata.replay.columns import from_columns, to_columns
from tacdata.replay.inverse_kinematics import JointPath, follow, rates
from tacdata.replay.robot import Robot, read_robot
from tacdata.replay.targets import FingertipTargets

HEADER = b"tacdata.joint_trajectory"
JOINT = "joint."
"""Prefix of the columns of joint values."""


class Joints(Exporter):
    """``NAME.joints.parquet``: joint values with the targets (`schemas/joint_trajectory.schema.json`)."""

    needs_robot = True

    def write(self, episodes: Sequence[FingertipTargets], directory: Path) -> list[str]:
        """Solve and write a new folder; return unreachable targets, as sentences."""
        if self.robot is None:
            raise UsageError("no robot", "a robot file", "name it with --robot")
        robot, sentences = read_robot(self.robot), []
        # Before the folder is made, as a robot file that fails should leave none.
        solved = [follow(robot, targets)[0] for targets in episodes]
        new_folder(directory)
        if solved:
            # Unknown limits are the robot's, so the first path has them all.
            self.remarks += [*robot.remarks, *_unchecked(solved[0])]
        for targets, path in zip(episodes, solved, strict=True):
            self.tables.append(use_table(path, targets))
        for targets, path in zip(episodes, solved, strict=True):
            stem = Path(targets.recording).stem
            sentences += [f"{stem}: {words}" for words in in_words(path, targets, robot.tolerance[1] is not None)]
            columns = to_columns(targets)
            header = _header(targets, path, robot, columns)
            documents.check(header, "joint_trajectory", stem)
            fields = columns | {f"{JOINT}{joint.name}": path.values[:, k] for k, joint in enumerate(path.joints)}
            table = pa.table(fields).replace_schema_metadata({HEADER: json.dumps(header)})
            with replacement(directory / f"{stem}.joints.parquet") as stream:
                pq.write_table(table, stream, compression="zstd", write_page_checksum=True)
        return sentences

    def read(self, directory: Path) -> list[FingertipTargets]:
        """Return the targets of a folder; `read_joints` gives the joint values."""
        return [targets for targets, _, _ in read_joints(directory)]


def read_joints(directory: Path) -> list[tuple[FingertipTargets, dict[str, np.ndarray], dict[str, Any]]]:
    """Return targets, joint values by name [rad or m], shape (n,), and the header of every file in a folder.

    Raises:
        UsageError: If there is none.
        FormatError: If a file is damaged.
    """
    paths = sorted(Path(directory).glob("*.joints.parquet"))
    if not paths:
        allowed = "a folder that tacdata export --format joints wrote"
        raise UsageError(f"no joint trajectory in {directory}", allowed, "check the path")
    return [_read(path) for path in paths]


def in_words(path: JointPath, targets: FingertipTargets, oriented: bool = True) -> list[str]:
    """Describe the targets that the robot cannot reach, with times; orientations too, where they are prescribed."""
    seconds = (targets.time_ns - targets.time_ns[0]) * 1e-9
    sentences = []
    for name, rows in path.unreached.items():
        cells = list(rows), targets.fingers.index(name)
        worst = 1000 * path.position_error[cells].max(), np.degrees(path.rotation_error[cells].max())
        share = f"{len(rows)} of {len(seconds)} targets ({_when(rows, seconds)})"
        error_words = f"{worst[0]:.1f} mm" + (f", {worst[1]:.0f} deg" if oriented else "")
        sentences.append(f"{name} does not reach {share}, off by up to {error_words}")
    for rows, words in (
        (path.uncoupled, f"would need mimic joints ({', '.join(path.mimics)}) to part from those that they follow"),
        (path.other_posture, "are left out: only another posture reaches them, which joints cannot take up in time"),
    ):
        if rows:
            sentences.append(f"{len(rows)} of {len(seconds)} targets ({_when(rows, seconds)}) {words}")
    links = {" and ".join(pair): rows for pair, rows in path.collisions.pairs.items()}
    for named, words in (
        (path.outside_workspace, "{}: {} targets lie outside the workspace"),
        (path.too_fast, "joint {} would have to be faster than its limit at {} times"),
        (links, "links {} run into each other at {} times"),
        (path.too_abrupt, "joint {} would have to accelerate more than its limit at {} times"),
    ):
        sentences += [f"{words.format(n, len(rows))} ({_when(rows, seconds)})" for n, rows in named.items()]
    return sentences


def use_table(path: JointPath, targets: FingertipTargets) -> str:
    """Return the largest errors of each fingertip, and how far each joint goes, as a table of text."""
    followed = np.isfinite(path.values).all(axis=1)
    speed, acceleration = rates(path.values, path.time_ns)
    rows = [
        f"{'fingertip':<24} {'off by [mm]':>12} {'turned [deg]':>13}   (largest, at {followed.sum()} times followed)"
    ]
    for k, name in enumerate(targets.fingers):
        place, turn = (
            float(error[followed, k].max()) if followed.any() else float("nan")
            for error in (path.position_error, path.rotation_error)
        )
        rows.append(f"{name:<24} {1000 * place:>12.3f} {np.degrees(turn):>13.2f}")
    rows.append(f"{'joint':<24} {'to its limit':>12} {'speed':>13} {'of its limit':>13} {'acceleration':>13}")
    for k, joint in enumerate(path.joints):
        trajectory = path.values[followed, k]
        # A joint that turns without end has no limit to come near.
        ends = [end for end in (joint.lower, joint.upper) if end is not None]
        room = (
            min((float(np.abs(trajectory - end).min()) for end in ends), default=float("inf"))
            if len(trajectory)
            else float("nan")
        )
        # Rates next to an unreached target are NaN; they are left out.
        fastest, hardest = (_largest(values[:, k]) for values in (speed, acceleration))
        share = f"{fastest / joint.velocity:.0%}" if joint.velocity else "unknown"
        unit = joint.unit
        rows.append(
            f"{joint.name:<24} {f'{room:.3g} {unit}':>12} {f'{fastest:.3g} {unit}/s':>13} {share:>13} "
            f"{f'{hardest:.3g} {unit}/s2':>13}"
        )
    return "\n".join(rows)


def _largest(values: np.ndarray) -> float:
    magnitudes = np.abs(values[np.isfinite(values)])
    return float(magnitudes.max()) if len(magnitudes) else float("nan")


def _unchecked(path: JointPath) -> list[str]:
    """Describe which speeds and accelerations were not compared with a limit, as none is known."""
    sentences = []
    if path.collisions.reason:
        sentences.append(f"whether links touch each other was not checked: {path.collisions.reason}")
    for what, quantity in (("velocity", "speed"), ("acceleration", "acceleration")):
        joints = [joint.name for joint in path.joints if getattr(joint, what) is None]
        if joints:
            which = "any joint" if len(joints) == len(path.joints) else f"joint {', '.join(joints)}"
            sentences.append(
                f"no limit of the {quantity} of {which} is known, so none was checked ({what} in the robot file)"
            )
    return sentences


def _when(rows: tuple[int, ...], seconds: np.ndarray) -> str:
    # Rows that follow each other are one stretch of time.
    parts = np.split(np.array(rows), 1 + np.flatnonzero(np.diff(rows) > 1))
    spans = [f"{seconds[part[0]]:.2f} to {seconds[part[-1]]:.2f} s" for part in parts[:3]]
    return ", ".join(spans) + (f" and {len(parts) - 3} more stretches" if len(parts) > 3 else "")


def _header(targets: FingertipTargets, path: JointPath, robot: Robot, columns: dict[str, np.ndarray]) -> dict[str, Any]:
    good = np.isfinite(path.values).all(axis=1)
    # JSON has no NaN: a path that is nowhere followed has no error.
    largest = [float(e[good].max()) if good.any() else None for e in (path.position_error, path.rotation_error)]
    parents = {"recording": targets.recording_hash, "urdf": robot.urdf_hash}
    return {
        "version": schemas.version("joint_trajectory"),
        "targets": targets.header(columns),
        "robot": robot.document,
        "urdf_hash": robot.urdf_hash,
        "joints": [asdict(joint) for joint in path.joints],
        "tolerance": {"position": robot.tolerance[0], "rotation": robot.tolerance[1]},
        "frames": len(path.values),
        "unreached": {name: list(rows) for name, rows in path.unreached.items()},
        "too_fast": {name: list(rows) for name, rows in path.too_fast.items()},
        "too_abrupt": {name: list(rows) for name, rows in path.too_abrupt.items()},
        "uncoupled": list(path.uncoupled),
        "other_posture": list(path.other_posture),
        "collisions": [{"links": list(pair), "rows": list(rows)} for pair, rows in path.collisions.pairs.items()],
        "outside_workspace": {name: list(rows) for name, rows in path.outside_workspace.items()},
        "errors": {"position": largest[0], "rotation": largest[1]},
        "provenance": provenance.stamp("tacdata export", parents, {"robot": robot.name}),
    }


def _read(path: Path) -> tuple[FingertipTargets, dict[str, np.ndarray], dict[str, Any]]:
    try:
        table = pq.read_table(path, page_checksum_verification=True)
        # A Parquet file of another program has no such entry.
        header = json.loads((table.schema.metadata or {})[HEADER])
    except (pa.ArrowException, OSError, KeyError, ValueError) as error:
        reason = str(error).splitlines()[0]
        fault = f"{path} holds no joint trajectory: {reason}"
        raise FormatError(fault, "a file of tacdata export", "export again") from None
    documents.check(header, "joint_trajectory", str(path))
    columns = {name: np.asarray(table.column(name).to_numpy()) for name in table.column_names}
    values = {name.removeprefix(JOINT): column for name, column in columns.items() if name.startswith(JOINT)}
    return from_columns(header["targets"], columns, str(path)), values, header
