"""State of contact at given displacements and multipliers: gaps, tractions, the resultant, the stiffness."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from tacdata.skin.member.columns import Columns


@dataclass(frozen=True)
class ContactTangent(Columns):
    """The linearization of one contact at one state; s contact nodes, b batch members."""

    active: torch.Tensor
    """Nodes whose mean gap is to be closed, shape (s, b), bool."""
    normal: torch.Tensor
    """Mean outward normal of the shape under each hat, in the sensor's frame [1], shape (s, 3, b)."""
    friction: torch.Tensor
    """Stiffness of each hat against slip, symmetric: xx, yy, zz, xy, yz, xz [N/mm], shape (s, 6, b)."""
    turn: torch.Tensor
    """Change of the normal force of each point as the normal turns, symmetric: xx, yy, zz, xy, yz, xz [N/mm], shape
    (f, k, 6, b), float32; no points where the shape is flat."""
    attraction: torch.Tensor | None = None
    """Slope of adhesive traction [MPa/mm] and the normal along which it acts, shape (f, k, 4, b)."""


@dataclass(frozen=True)
class ContactForces(Columns):
    """Tractions of one contact; s contact nodes, b batch members."""

    force: torch.Tensor
    """Resultant on the skin [N], shape (3, b)."""
    gap: torch.Tensor
    """Mean signed distance to the shape under each hat [mm], shape (s, b)."""
    pressure: torch.Tensor
    """Normal traction at the nodes [MPa], 0 where not active, shape (s, b)."""
    shear: torch.Tensor
    """Tangential traction in the shape's frame [MPa], shape (s, 3, b)."""
    local: torch.Tensor
    """Mean place of each hat in the shape's frame [mm], shape (s, 3, b)."""
    tangent: ContactTangent
    """Their change with the displacements."""
    energy: torch.Tensor | None = None
    """Potential of the attraction [N mm], 0 when parted, shape (b,); None without adhesion."""
