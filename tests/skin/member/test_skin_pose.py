"""Poses of a batch, and what its members are made of."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from skin_examples import MATERIAL, joined

from tacdata.indenters.cylinder import Cylinder
from tacdata.indenters.sphere import Sphere
from tacdata.skin.member.conditions import conditions
from tacdata.skin.member.pose import Pose, turned


def turn(yaw=(0.0,), tilt_x=(0.0,), tilt_y=(0.0,)):
    return turned(*(torch.tensor(angles, dtype=torch.float64) for angles in (yaw, tilt_x, tilt_y)))


def test_turns_are_right_handed_about_the_sensors_axes():
    quarter = (np.pi / 2,)
    x, y, z = torch.eye(3, dtype=torch.float64)
    assert torch.allclose(turn(yaw=quarter)[..., 0] @ x, y)
    assert torch.allclose(turn(tilt_x=quarter)[..., 0] @ y, z)
    assert torch.allclose(turn(tilt_y=quarter)[..., 0] @ z, x)


def test_yaw_turns_about_the_shapes_own_axis_and_tilts_lean_it():
    """The axis of a yawed and tilted shape is that of one tilted alone."""
    both, leaning = turn((0.7,), (0.2,), (-0.3,))[..., 0], turn((0.0,), (0.2,), (-0.3,))[..., 0]
    assert torch.allclose(both[:, 2], leaning[:, 2])
    assert not torch.allclose(both[:, 0], leaning[:, 0])


def test_turns_are_rotations_member_by_member():
    angles = np.random.default_rng(0).uniform(-3, 3, (3, 4))
    many = turn(*map(tuple, angles))
    assert many.shape == (3, 3, 4) and many.is_contiguous()
    for k in range(4):
        one = turn(*((float(angle),) for angle in angles[:, k]))[..., 0]
        assert torch.equal(many[..., k], one)
        assert torch.allclose(one @ one.T, torch.eye(3, dtype=torch.float64)) and torch.det(one) > 0


def test_a_pose_takes_the_marked_members_of_another():
    one, other = (Pose(torch.full((3, 2), v), torch.full((3, 3, 2), v)) for v in (1.0, 2.0))
    kept = one.copy()
    one.put_where(torch.tensor([False, True]), other)
    assert one.place[0].tolist() == [1.0, 2.0] and one.turn[2, 1].tolist() == [1.0, 2.0]
    assert kept.place[0].tolist() == [1.0, 1.0]


SOFT = conditions(replace(MATERIAL, youngs_modulus=0.2), 0.1, Sphere(2.0), thickness=1.1)
STIFF = conditions(replace(MATERIAL, youngs_modulus=0.5), 0.3, Cylinder(1.0, 3.0, 0.2))


def test_a_member_is_what_material_and_shape_say():
    assert SOFT.modulus.item() == 0.2 and SOFT.friction.item() == 0.1 and SOFT.thickness.item() == 1.1
    assert STIFF.indenter[:, 0].tolist() == [1.0, 3.0, 0.2, 0, 0, 0, 0, 0]
    shear, bulk = MATERIAL.shear_modulus / 0.3, MATERIAL.bulk_modulus / 0.3
    assert STIFF.law[:2, 0].tolist() == pytest.approx([0.5 * shear, 0.5 * bulk])


def test_members_are_put_repeated_and_taken():
    both = joined(SOFT, STIFF)
    assert both.modulus.tolist() == [0.2, 0.5]
    assert SOFT.modulus.tolist() == [0.2]
    taken = both.take(torch.tensor([1, 0, 1]))
    assert taken.friction.tolist() == [0.3, 0.1, 0.3]
    assert torch.equal(taken.law[:, 1], SOFT.law[:, 0]) and taken.indenter.is_contiguous()


def test_the_other_precision_follows_what_is_put():
    """A stale one would solve the next press with the last one's material."""
    both = joined(SOFT, SOFT)
    assert both.to(torch.float32).law.dtype == torch.float32
    assert both.to(torch.float64) is both
    both.put(torch.tensor([1]), STIFF)
    assert both.to(torch.float32).modulus.tolist() == pytest.approx([0.2, 0.5])
    assert torch.allclose(both.to(torch.float32).law.double(), both.law)
