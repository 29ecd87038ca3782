"""Properties that may differ between members of a batch on one mesh: elasticity, thickness, friction, indenter."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, fields, replace

import numpy as np
import torch

from tacdata.indenters import Indenter
from tacdata.sensor import Material
from tacdata.skin.materials import load_law
from tacdata.skin.member.columns import Columns


@dataclass(frozen=True)
class Conditions(Columns):
    """Material and indenter of a batch member; one column a member, all tensors on one device."""

    law: torch.Tensor
    """Parameters of the material law [units of the law], shape (8, b)."""
    modulus: torch.Tensor
    """Young's modulus, by which contact stiffness is scaled [MPa], shape (b,)."""
    thickness: torch.Tensor
    """Thickness of the slab over that of the mesh [1], shape (b,)."""
    friction: torch.Tensor
    """Coulomb's coefficient between indenter and skin [1], shape (b,)."""
    indenter: torch.Tensor
    """Parameters of the indenter's distance function [mm, rad], shape (8, b)."""
    shape: torch.Tensor
    """Number of that function (`shape_number`) [1], shape (b,)."""

    def to(self, dtype: torch.dtype) -> Conditions:
        """Return the same in another precision; itself if it has that one."""
        if dtype == self.law.dtype:
            return self
        return Conditions(*(getattr(self, field.name).to(dtype) for field in fields(self)))

    def on(self, device: str) -> Conditions:
        """Return the same on a device."""
        return Conditions(*(getattr(self, field.name).to(device) for field in fields(self)))

    def pressed_by(self, indenter: Indenter, device: str = "cpu") -> Conditions:
        """Return the same under a shape whose data lie on a device, such as "cuda:0"."""
        mine = str(self.law.device)
        parameters, number = indenter.device_parameters(device), shape_number(indenter)
        return replace(self, indenter=_column(parameters, mine), shape=_scalar(number, mine))


def shape_number(indenter: Indenter) -> float:
    """Return the number that a shape's distance function goes by: a checksum of the shape's name [1]."""
    return float(zlib.crc32(indenter.shape.encode()))


def conditions(
    material: Material, friction: float, indenter: Indenter | None = None, thickness: float = 1.0, device: str = "cpu"
) -> Conditions:
    """Return the conditions of one member, in float64."""
    return Conditions(
        _column(load_law(material.law).parameters(material), device),
        _scalar(material.youngs_modulus, device),
        _scalar(thickness, device),
        _scalar(friction, device),
        _column(indenter.device_parameters(device) if indenter else (), device),
        _scalar(shape_number(indenter) if indenter else 0.0, device),
    )


def _column(values: tuple[float, ...], device: str) -> torch.Tensor:
    padded = np.array([*values, *([0.0] * (8 - len(values)))])
    return torch.as_tensor(padded, device=device)[:, None].contiguous()


def _scalar(value: float, device: str) -> torch.Tensor:
    return torch.tensor([value], dtype=torch.float64, device=device)
