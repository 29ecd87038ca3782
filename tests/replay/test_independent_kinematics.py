"""Joint values are checked by other kinematics: products of the URDF's matrices, without MuJoCo."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from tacdata.exporters.exporter import exporter
from tacdata.exporters.joints import read_joints
from tacdata.replay.targets import FingertipTargets

HINGE = (
    '<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{next}"/><origin xyz="{xyz}" rpy="{rpy}"/>'
    '<axis xyz="{axis}"/><limit lower="-2.8" upper="2.8" effort="1" velocity="3"/></joint>'
)
BONES = (
    ("0 0 0.15", "0 0 0.4", "0 0 1"),
    ("0 0.1 0.05", "1.2 0 0", "0 0.6 0.8"),
    ("0.3 0 0", "0 0.3 -0.2", "0 0.6 0.8"),
    ("0.25 0 0.02", "0 1.1 0", "1 0 0"),
    ("0 0.08 0", "-0.9 0 0.2", "0 1 0"),
    ("0 0.03 0.06", "0 0.5 0", "0.6 0 -0.8"),
)
"""Offset [m], roll, pitch and yaw [rad] and axis of each hinge: none of them along the axes of the one before."""
ARM = (
    '<robot name="own">'
    + "".join(f'<link name="l{k}"/>' for k in range(len(BONES) + 1))
    + "".join(HINGE.format(k=k, next=k + 1, xyz=a, rpy=b, axis=c) for k, (a, b, c) in enumerate(BONES))
    + "</robot>"
)
TIP = {"position": [0.01, 0.02, 0.05], "quaternion": [0.0, 0.6, 0.0, 0.8]}
BASE = {"position": [0.1, -0.2, 0.05], "quaternion": [0.0, 0.0, 0.3826834, 0.9238795]}


def pose(position, rotation):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation.as_matrix(), position
    return matrix


def placed(entry):
    return pose(entry["position"], Rotation.from_quat(entry["quaternion"]))


def numbers(element, name, fallback):
    return np.array((fallback if element is None else element.get(name, fallback)).split(), float)


def link_of(joint, end):
    element = joint.find(end)
    assert element is not None
    return element.get("link")


def tip_poses(urdf, link, values, base, tip):
    """Poses of a fingertip on a link at joint values by name [rad], shape (n,) each; shape (n, 4, 4)."""
    parents = {link_of(j, "child"): j for j in ElementTree.fromstring(urdf).findall("joint")}
    matrix, at = placed(tip)[None], link
    while at in parents:
        joint = parents[at]
        origin = joint.find("origin")
        # URDF: fixed axes, roll first.
        here = pose(numbers(origin, "xyz", "0 0 0"), Rotation.from_euler("xyz", numbers(origin, "rpy", "0 0 0")))
        if joint.get("type") != "fixed":
            axis = numbers(joint.find("axis"), "xyz", "1 0 0")
            turn = np.zeros((len(values[joint.get("name")]), 4, 4))
            turns = Rotation.from_rotvec(values[joint.get("name")][:, None] * axis / np.linalg.norm(axis))
            turn[:, :3, :3], turn[:, 3, 3] = turns.as_matrix(), 1.0
            here = here @ turn
        matrix, at = here @ matrix, link_of(joint, "parent")
    return placed(base) @ matrix


def targets_at(poses):
    """Targets at poses, shape (n, 4, 4), thirty a second."""
    count = len(poses)
    place = poses[:, None, :3, 3].copy()
    return FingertipTargets(
        "episode-000000.mcap",
        "e" * 64,
        "grasp",
        "table",
        30.0,
        ("index",),
        "direct",
        {},
        np.rint(np.arange(count) * 1e9 / 30).astype(np.int64),
        place,
        Rotation.from_matrix(poses[:, :3, :3]).as_quat()[:, None],
        place,
        np.full((count, 1), np.nan),
        np.zeros((count, 1), bool),
    )


def exported(folder, urdf, link, wanted, names):
    """Joint values by name and header, for targets at the poses of joint values, and those poses."""
    poses = tip_poses(urdf, link, dict(zip(names, wanted.T, strict=True)), BASE, TIP)
    (folder / "arm.urdf").write_text(urdf)
    home = dict(zip(names, wanted[0].tolist(), strict=True))
    document = {"version": "1.0", "name": "arm", "urdf": "arm.urdf", "base": BASE, "home": home}
    (folder / "robot.yaml").write_text(yaml.safe_dump(document | {"fingers": {"index": {"link": link, **TIP}}}))
    targets = targets_at(poses)
    writer = exporter("joints", folder / "robot.yaml")
    words = writer.write([targets], folder / "out")
    ((_, values, header),) = read_joints(folder / "out")
    return values, header, poses, words, writer.tables


def missed(urdf, link, values, poses):
    """Largest distance [m] and angle [rad] of the fingertip from its targets, by the other kinematics."""
    away = np.linalg.inv(poses) @ tip_poses(urdf, link, values, BASE, TIP)
    known = np.isfinite(away).all(axis=(1, 2))
    angle = Rotation.from_matrix(away[known, :3, :3]).magnitude()
    return known, np.linalg.norm(away[known, :3, 3], axis=1).max(), angle.max()


def swinging(count, joints):
    phase = np.linspace(0, 2 * np.pi, count)[:, None]
    return 0.5 + 0.4 * np.sin(phase + np.arange(joints)) * np.linspace(1.0, 0.5, joints)


def test_an_arm_of_ones_own_brings_the_fingertip_to_its_targets(tmp_path):
    names = [f"j{k}" for k in range(6)]
    values, header, poses, words, (table,) = exported(tmp_path, ARM, "l6", swinging(60, 6), names)
    known, place, angle = missed(ARM, "l6", values, poses)
    assert known.all() and not words
    assert place < 5e-4 and angle < np.radians(2.0)  # the tolerances of a robot file that states none
    assert header["errors"]["position"] == pytest.approx(place, abs=1e-7)
    assert header["errors"]["rotation"] == pytest.approx(angle, abs=1e-6)
    assert f"{1000 * place:.3f}" in table


def test_a_fingertip_that_comes_out_turned_is_no_answer(tmp_path):
    """Hinges stop short in a part of the path."""
    short = ARM.replace('lower="-2.8" upper="2.8"', 'lower="-2.8" upper="0.8"')
    names, wanted = [f"j{k}" for k in range(6)], swinging(60, 6)
    poses = tip_poses(ARM, "l6", dict(zip(names, wanted.T, strict=True)), BASE, TIP)
    (tmp_path / "arm.urdf").write_text(short)
    document = {"version": "1.0", "name": "arm", "urdf": "arm.urdf", "base": BASE}
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(document | {"fingers": {"index": {"link": "l6", **TIP}}}))
    words = exporter("joints", tmp_path / "robot.yaml").write([targets_at(poses)], tmp_path / "out")
    ((_, values, header),) = read_joints(tmp_path / "out")
    known, place, angle = missed(short, "l6", values, poses)
    assert 0 < known.sum() < 60 and place < 5e-4 and angle < np.radians(2.0)
    assert header["unreached"]["index"] == np.flatnonzero(~known).tolist()
    assert any("index does not reach" in sentence and "deg" in sentence for sentence in words)
