"""The state of a batch: all that decides the forces of each member."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from tacdata.skin.contact.history import ContactHistory
from tacdata.skin.member.columns import Columns
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose


@dataclass
class Configuration(Columns):
    """Where the skin and the shapes are, what they are made of, and what contact remembers; one column a member."""

    u: torch.Tensor
    """Displacements [mm], shape (n, 3, b), float64."""
    conditions: Conditions
    """Of the members."""
    poses: tuple[Pose, ...]
    """Of each contact's shape."""
    histories: tuple[ContactHistory, ...]
    """Of each contact."""
    friction_tangent: torch.Tensor
    """Stiffness of slipping points: 0 by the secant of friction, 1 by its tangent, shape (b,)."""
