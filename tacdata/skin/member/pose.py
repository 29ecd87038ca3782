"""Where a rigid shape is: its lowest point and its orientation, for every member of a batch."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from tacdata.skin.member.columns import Columns


@dataclass(frozen=True)
class Pose(Columns):
    """Pose of a shape in the sensor's frame; one column a batch member."""

    place: torch.Tensor
    """Place of the shape's origin [mm], shape (3, b)."""
    turn: torch.Tensor
    """Rotation from the shape's frame to the sensor's, shape (3, 3, b)."""


def turned(yaw: torch.Tensor, tilt_x: torch.Tensor, tilt_y: torch.Tensor) -> torch.Tensor:
    """Return rotations Rx(tilt_x) Ry(tilt_y) Rz(yaw), angles [rad] of shape (b,), as shape (3, 3, b).

    The yaw turns the shape about its own axis; the tilts then lean that axis about the sensor's x and y.
    """
    zero, one = torch.zeros_like(yaw), torch.ones_like(yaw)

    def matrix(*rows: tuple[torch.Tensor, ...]) -> torch.Tensor:
        return torch.stack([torch.stack(row) for row in rows])

    c, s = torch.cos(yaw), torch.sin(yaw)
    about_z = matrix((c, -s, zero), (s, c, zero), (zero, zero, one))
    c, s = torch.cos(tilt_x), torch.sin(tilt_x)
    about_x = matrix((one, zero, zero), (zero, c, -s), (zero, s, c))
    c, s = torch.cos(tilt_y), torch.sin(tilt_y)
    about_y = matrix((c, zero, s), (zero, one, zero), (-s, zero, c))
    return torch.einsum("ijb,jkb,klb->ilb", about_x, about_y, about_z).contiguous()
