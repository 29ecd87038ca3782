"""The quantities that each parameter of a press moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import torch

from tacdata.errors import FormatError
from tacdata.indenters import Indenter
from tacdata.sensor import Sensor
from tacdata.skin.derivatives.contact import ConditionsChange
from tacdata.skin.materials import load_law
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose

_STEP = 1e-5
"""Step of the central differences that turn a parameter into the numbers of a law or a shape, over its size [1]."""


def directions(
    sensor: Sensor, indenter: Indenter, parameters: list[str], own: Conditions, touch: Pose
) -> ConditionsChange:
    """Return the change by a unit of each parameter, one column a parameter.

    Args:
        sensor: Its material.
        indenter: Its sizes.
        parameters: Their names (`tacdata.skin.derivatives.parameter_names.known`).
        own: Conditions of the press, one member.
        touch: Pose of the indenter at depth 0, one member.
    """
    count, device = len(parameters), own.law.device

    def zeros(*shape: int) -> torch.Tensor:
        return torch.zeros(*shape, count, dtype=torch.float64, device=device)

    conditions = Conditions(zeros(8), zeros(), zeros(), zeros(), zeros(8), zeros())
    change = ConditionsChange(conditions, Pose(zeros(3), zeros(3, 3)))
    for column, name in enumerate(parameters):
        if name in ("x", "y", "z"):
            change.pose.place["xyz".index(name), column] = 1.0
        elif name in ("yaw", "tilt_x", "tilt_y"):
            change.pose.turn[:, :, column] = _turning(name, touch.turn[:, :, 0])
        elif name == "thickness":
            # The scale is one of heights; the outer face, where the indenter starts, rises with it.
            conditions.thickness[column] = own.thickness[0] / sensor.skin.thickness
            change.pose.place[2, column] = touch.place[2, 0] / sensor.skin.thickness
        elif name == "friction":
            conditions.friction[column] = 1.0
        elif name == "bonding":
            continue  # `PathDerivatives` moves the held faces
        elif name.startswith("indenter/"):
            conditions.indenter[:, column] = _padded(_by_size(indenter, name.removeprefix("indenter/")), device)
        else:
            conditions.law[:, column] = _padded(_by_material(sensor, name.removeprefix("material/")), device)
            conditions.modulus[column] = float(name == "youngs_modulus")
    return change


def _turning(name: str, turn: torch.Tensor) -> torch.Tensor:
    """Return the change of a turn Rx Ry Rz per degree, shape (3, 3)."""
    axis = torch.zeros(3, dtype=torch.float64)
    axis["xyz".index("z" if name == "yaw" else name[-1])] = np.radians(1.0)
    # Rz is the last factor, so that its change multiplies from the right; those of Rx and Ry, from the left.
    if name == "yaw":
        return turn @ _cross(axis.to(turn))
    if name == "tilt_y":
        # About the y axis after the tilt about x, which the shape's axis (third column) gives.
        lean = torch.atan2(-turn[1, 2], turn[2, 2])
        axis = float(axis[1]) * torch.stack([torch.zeros_like(lean), torch.cos(lean), torch.sin(lean)])
    return _cross(axis.to(turn)) @ turn


def _cross(v: torch.Tensor) -> torch.Tensor:
    zero = torch.zeros_like(v[0])
    return torch.stack(
        [torch.stack([zero, -v[2], v[1]]), torch.stack([v[2], zero, -v[0]]), torch.stack([-v[1], v[0], zero])]
    )


def _by_size(indenter: Indenter, name: str) -> np.ndarray:
    value = float(getattr(indenter, name))
    return _difference(lambda v: replace(indenter, **{name: v}).parameters, value, _STEP * value)


def _by_material(sensor: Sensor, name: str) -> np.ndarray:
    material = sensor.material
    law = load_law(material.law)
    if name in ("youngs_modulus", "poisson_ratio"):
        value = getattr(material, name)
        # The bulk modulus grows as 1 / (0.5 - nu): a step must be small against that distance.
        room = value if name == "youngs_modulus" else 0.5 - value
        return _difference(lambda v: law.parameters(replace(material, **{name: v})), value, _STEP * room)
    field, _, entry = name.partition("/")
    whole = getattr(law.configured(material.parameters), field)
    value = float(whole[int(entry)] if entry else whole)

    def numbers(changed: float) -> tuple[float, ...]:
        new: Any = changed
        if entry:
            new = [changed if k == int(entry) else old for k, old in enumerate(whole)]
        return law.parameters(replace(material, parameters={**material.parameters, field: new}))

    # Many parameters are 0 by default and still need a step.
    return _difference(numbers, value, _STEP * max(abs(value), 0.1))


def _difference(numbers: Callable[[float], tuple[float, ...]], value: float, step: float) -> np.ndarray:
    """Return a central difference; at the end of a parameter's range, a one-sided one.

    Raises:
        FormatError: If the parameter cannot move either way.
    """
    ends = []
    for sign in (1.0, -1.0):
        try:
            ends.append((sign, np.array(numbers(value + sign * step))))
        except FormatError:
            # At the end of the range the value itself serves, and the difference is one-sided.
            ends.append((0.0, np.array(numbers(value))))
    (high, upper), (low, lower) = ends
    # Neither way is allowed: the law's error is raised again, as it says why.
    if high == low:
        numbers(value + step)
    return (upper - lower) / ((high - low) * step)


def _padded(values: np.ndarray, device: torch.device) -> torch.Tensor:
    return torch.as_tensor(np.concatenate([values, np.zeros(8 - len(values))]), device=device)
