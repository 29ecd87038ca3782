"""What may differ between the members of a batch on one mesh: elastic constants, thickness, friction, the indenter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import torch

from tacdata.indenters import Indenter
from tacdata.sensor import Material
from tacdata.skin.materials import load_law

NAMES = ("law", "modulus", "thickness", "friction", "indenter")
"""The tensors of `Conditions`."""


@dataclass(frozen=True)
class Conditions:
    """One column a member; every tensor on the same device."""

    law: torch.Tensor
    """Parameters of the material law [as the law says], shape (8, b)."""
    modulus: torch.Tensor
    """Young's modulus, by which contact stiffness is scaled [MPa], shape (b,)."""
    thickness: torch.Tensor
    """Thickness of the slab over that of the mesh [1], shape (b,)."""
    friction: torch.Tensor
    """Coulomb's coefficient between indenter and skin [1], shape (b,)."""
    indenter: torch.Tensor
    """Parameters of the indenter's distance function [mm, rad], shape (8, b)."""
    _other: dict[torch.dtype, Conditions] = field(default_factory=dict, compare=False, repr=False)

    def to(self, dtype: torch.dtype) -> Conditions:
        """Return the same in another precision; made once."""
        if dtype == self.law.dtype:
            return self
        if dtype not in self._other:
            self._other[dtype] = Conditions(
                self.law.to(dtype), self.modulus.to(dtype), self.thickness.to(dtype), self.friction.to(dtype),
                self.indenter.to(dtype),
            )
        return self._other[dtype]

    def put(self, column: int, other: Conditions) -> None:
        """Make the single member of ``other`` this batch's member ``column``."""
        for name in NAMES:
            getattr(self, name)[..., column] = getattr(other, name)[..., 0]
        self._other.clear()

    def put_all(self, columns: torch.Tensor, others: Sequence[Conditions]) -> None:
        """Make single members this batch's members of the given indices, shape (k,)."""
        for name in NAMES:
            getattr(self, name)[..., columns] = torch.cat([getattr(other, name) for other in others], dim=-1)
        self._other.clear()

    def retake(self, other: Conditions, which: torch.Tensor) -> None:
        """Take members of another batch, by index, into the tensors that this one has."""
        for name in NAMES:
            torch.index_select(getattr(other, name), -1, which, out=getattr(self, name))

    def pressed_by(self, indenter: Indenter) -> Conditions:
        """Return the same under a shape."""
        device = str(self.law.device)
        return replace(self, indenter=_column(indenter.device_parameters(device), device), _other={})

    def repeat(self, count: int) -> Conditions:
        """Return ``count`` equal members made of a single one."""
        return replace(
            self, law=self.law.repeat(1, count), modulus=self.modulus.repeat(count),
            thickness=self.thickness.repeat(count), friction=self.friction.repeat(count),
            indenter=self.indenter.repeat(1, count), _other={},
        )

    def take(self, which: torch.Tensor) -> Conditions:
        """Return some members, by index, shape (k,)."""
        return Conditions(
            self.law[:, which].contiguous(), self.modulus[which], self.thickness[which], self.friction[which],
            self.indenter[:, which].contiguous(),
        )


def conditions(
    material: Material, friction: float, indenter: Indenter | None = None, thickness: float = 1.0, device: str = "cpu"
) -> Conditions:
    """Return the conditions of one member, in float64."""
    return Conditions(
        _column(load_law(material.law).parameters(material), device),
        _scalar(material.youngs_modulus, device), _scalar(thickness, device), _scalar(friction, device),
        _column(indenter.device_parameters(device) if indenter else (), device),
    )


def _column(values: tuple[float, ...], device: str) -> torch.Tensor:
    padded = np.array([*values, *([0.0] * (8 - len(values)))])
    return torch.as_tensor(padded, device=device)[:, None].contiguous()


def _scalar(value: float, device: str) -> torch.Tensor:
    return torch.tensor([value], dtype=torch.float64, device=device)
