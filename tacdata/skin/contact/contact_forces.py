"""What contact does at given displacements: tractions at the quadrature points, their stiffness, the resultant."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from tacdata.skin.member.columns import Columns


@dataclass(frozen=True)
class ContactTangent(Columns):
    """The stiffness of one contact at one state; f faces, k points each, b batch members."""

    pressure: torch.Tensor
    """Normal traction [MPa], shape (f, k, b); where it is 0, ``stiffness`` means nothing."""
    stiffness: torch.Tensor
    """Of each point per area, symmetric: xx, yy, zz, xy, yz, xz [MPa/mm], shape (f, k, 6, b)."""
    touched: torch.Tensor
    """Faces with a point that carries load, shape (f, b), bool."""
    attraction: torch.Tensor | None = None
    """Slope of adhesive traction [MPa/mm] and the normal along which it acts, shape (f, k, 4, b)."""


@dataclass(frozen=True)
class ContactForces(Columns):
    """Tractions of one contact; f faces, k points each, b batch members."""

    force: torch.Tensor
    """Resultant on the skin [N], shape (3, b)."""
    gap: torch.Tensor
    """Signed distance to the shape [mm], shape (f, k, b)."""
    pressure: torch.Tensor
    """Normal traction [MPa], shape (f, k, b)."""
    shear: torch.Tensor
    """Tangential traction in the shape's frame [MPa], shape (f, k, 3, b)."""
    local: torch.Tensor
    """Place of each point in the shape's frame [mm], shape (f, k, 3, b)."""
    tangent: ContactTangent
    """Their change with the displacements."""
    energy: torch.Tensor | None = None
    """Potential of the attraction [N mm], 0 when parted, shape (b,); None without adhesion."""
