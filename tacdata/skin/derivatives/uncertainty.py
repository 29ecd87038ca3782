"""Standard deviations of map and forces from the spreads of uncertain parameters.

Spreads are standard deviations of parameters (`tacdata.skin.derivatives.parameter_names.known`), independent of each
other, from the
sensor file's ``uncertainty``. To first order var(f) = sum_p (df/dp)^2 sigma_p^2 (JCGM 100:2008, eq. 10);
`sampled_spread` tests the range of validity by whole presses. It ends where the derivative vanishes or jumps within the
spread: under the tip, where depth falls with the square of a shift, at a punch's edge, in a press no deeper than the
spread of z, and for protrusions that may or may not touch.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np
import torch

from tacdata.errors import SolveError, UsageError
from tacdata.skin.derivatives.parameter_names import check
from tacdata.skin.derivatives.parameters import directions
from tacdata.skin.derivatives.press import Sensitivity, sensitivities
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.equilibrium import Equilibrium

if TYPE_CHECKING:
    from tacdata.skin.model import SkinModel
    from tacdata.skin.solve.batch import PlacedPress


@dataclass(frozen=True)
class Uncertainty:
    """One standard deviation of the quantities of a state."""

    surface: np.ndarray
    """Of undeformed minus deformed height at the pixels [mm], shape (pixels_x, pixels_y)."""
    force: np.ndarray
    """Of the force of the skin on the indenter [N], shape (3,)."""
    taxel_force: np.ndarray
    """Of the normal force on each protrusion [N], shape (taxels,)."""
    taxel_closure: np.ndarray
    """Of the downward displacement of each protrusion's rim [mm], shape (taxels,)."""


QUANTITIES = ("surface", "force", "taxel_force", "taxel_closure")
"""Quantities with an uncertainty."""


def propagate(sensitivity: Sensitivity, spreads: Mapping[str, float]) -> Uncertainty:
    """Return the standard deviations to first order; parameters without a spread are taken as exact.

    Args:
        sensitivity: Derivatives by all parameters that have a spread.
        spreads: Standard deviations by name, in the parameters' units.

    Raises:
        UsageError: If the derivative by one of them is missing.
    """
    if missing := sorted(set(spreads) - set(sensitivity.parameters)):
        raise UsageError(
            f"spreads of {', '.join(missing)} without derivatives",
            ", ".join(sensitivity.parameters),
            "ask `sensitivities` for these parameters too",
        )
    sigma = np.array([spreads.get(name, 0.0) for name in sensitivity.parameters])
    return Uncertainty(
        *(np.sqrt(np.tensordot(sigma**2, getattr(sensitivity, name) ** 2, axes=1)) for name in QUANTITIES)
    )


def uncertainties(
    model: SkinModel, request: PressRequest, spreads: Mapping[str, float] | None = None
) -> Iterator[tuple[float, Equilibrium, Uncertainty]]:
    """Yield the requested states of a press with their standard deviations to first order.

    Args:
        model: The skin.
        request: The press.
        spreads: Standard deviations by name, in the parameters' units; default: those of the sensor file.

    Raises:
        UsageError: If there are none, or one is not of a parameter of this press.
        SolveError: If a state or its derivatives are not found.
    """
    spreads = _checked(model, request, spreads)
    for depth, state, sensitivity in sensitivities(model, request, list(spreads)):
        yield depth, state, propagate(sensitivity, spreads)


def sampled_spread(
    model: SkinModel,
    request: PressRequest,
    spreads: Mapping[str, float],
    samples: int,
    seed: int = 0,
    capacity: int = 1,
) -> list[tuple[float, Uncertainty]]:
    """Return the standard deviations among whole presses with normally drawn parameters, for every depth.

    Their own relative uncertainty is 1 / sqrt(2 samples) where the distribution is normal.

    Args:
        model: The skin.
        request: The press.
        spreads: Standard deviations by name, in the parameters' units; of material and indenter they must be small, as
            these are moved along their first derivatives.
        samples: How many presses, at least 2. The spread of bonding is not drawn, but taken to first order.
        seed: Of the random numbers.
        capacity: How many presses are in work at a time.

    Raises:
        UsageError: If fewer than two samples are asked for, or a spread is not of a parameter of this press.
        SolveError: If one of the presses is not solved.
    """
    spreads = dict(_checked(model, request, spreads))
    if samples < 2:
        raise UsageError(f"{samples} samples", "at least 2", "draw more presses")
    bonding = spreads.pop("bonding", 0.0)
    if bonding:
        # Held faces do not move while a press is solved; to first order they do, and independently of the rest.
        linear = [own for _, _, own in uncertainties(model, request, {"bonding": bonding})]
        if not spreads:
            return list(zip(request.depths, linear, strict=True))
        drawn = sampled_spread(model, request, spreads, samples, seed, capacity)
        return [(depth, _joined(one, linear_one)) for (depth, one), linear_one in zip(drawn, linear, strict=True)]
    moves = np.random.default_rng(seed).normal(size=(samples, len(spreads))) * list(spreads.values())
    presses = (_moved(model, request, k, dict(zip(spreads, values, strict=True))) for k, values in enumerate(moves))
    batch = model.skin.batch([request], min(capacity, samples))
    found: list[list[Equilibrium]] = [[] for _ in range(samples)]
    for number, _, state in batch.run(presses, model.skin.reader.states):
        if isinstance(state, SolveError):
            raise state
        found[number].append(state)
    return [(depth, _spread_of(model, [states[k] for states in found])) for k, depth in enumerate(request.depths)]


def _joined(first: Uncertainty, second: Uncertainty) -> Uncertainty:
    """Return the standard deviations of two independent causes together."""
    return Uncertainty(*(np.hypot(getattr(first, name), getattr(second, name)) for name in QUANTITIES))


def _checked(model: SkinModel, request: PressRequest, spreads: Mapping[str, float] | None) -> Mapping[str, float]:
    spreads = model.sensor.uncertainty if spreads is None else spreads
    if not spreads or not all(0 <= value < np.inf for value in spreads.values()):
        raise UsageError(
            f"spreads {dict(spreads)}",
            "a finite standard deviation of at least one parameter, in its unit",
            "add them as uncertainty to the sensor file, for example thickness: 0.2",
        )
    check(model.sensor, request.indenter, list(spreads))
    return spreads


def _moved(model: SkinModel, request: PressRequest, number: int, moves: dict[str, float]) -> PlacedPress:
    """Return the press with its parameters moved."""
    press = model.skin.placed(number, request)
    names, values = list(moves), torch.tensor(list(moves.values()), dtype=torch.float64)
    pose = Pose(*(torch.as_tensor(value)[..., None] for value in (press.touch, press.turn)))
    changes = directions(model.sensor, request.indenter, names, press.conditions, pose)
    pairs = ((getattr(press.conditions, f.name), getattr(changes.conditions, f.name)) for f in fields(Conditions))
    conditions = Conditions(*(value + (change * values).sum(dim=-1, keepdim=True) for value, change in pairs))
    place = (changes.pose.place * values).sum(dim=-1).numpy()
    # A place too low is a press too deep, on a path that starts where the indenter touches.
    place[2] -= moves.get("z", 0.0)
    depths = tuple(max(depth - moves.get("z", 0.0), 0.0) if depth else 0.0 for depth in request.depths)
    turn = press.turn + (changes.pose.turn * values).sum(dim=-1).numpy()
    # The nearest rotation.
    left, _, right = np.linalg.svd(turn)
    path = replace(press.path, depths=depths)
    return replace(press, path=path, touch=press.touch + place, turn=left @ right, conditions=conditions)


def _spread_of(model: SkinModel, states: list[Equilibrium]) -> Uncertainty:
    grid, face = model.sensor.map, model.skin.face
    values = [
        (
            face.depth_map(grid.x, grid.y, state.displacement, grid.sampling),
            state.force,
            state.taxel_force,
            state.taxel_closure,
        )
        for state in states
    ]
    return Uncertainty(*(np.std(value, axis=0, ddof=1) for value in zip(*values, strict=True)))
