"""Derivatives of a press's map, forces and taxels by pose, sizes and material."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch

from tacdata.errors import SolveError
from tacdata.skin.derivatives.bonding import Bonding
from tacdata.skin.derivatives.compilation import derivative_kernels
from tacdata.skin.derivatives.contact import ConditionsChange
from tacdata.skin.derivatives.equilibria import TOLERANCE, PathDerivatives, Slack
from tacdata.skin.derivatives.parameter_names import check, known
from tacdata.skin.derivatives.parameters import directions
from tacdata.skin.member.pose import Pose
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.equilibrium import Equilibrium
from tacdata.skin.solve.passage import Passage, PathRecorder
from tacdata.skin.surface.depth_map import DepthRaster
from tacdata.warp_runtime import load_kernels

if TYPE_CHECKING:
    from tacdata.skin.model import SkinModel

_MAP_STEP = 1e-6
"""Largest displacement of the central difference of the map [mm]: the height has kinks at the edges of triangles, so
that it must be small; it is exact to 1e-12 mm."""


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of one state by p parameters; units are those of the quantity over the parameter's."""

    parameters: tuple[str, ...]
    """Names of the parameters, as `tacdata.skin.derivatives.parameter_names.known` gives them."""
    units: tuple[str, ...]
    """Their units."""
    surface: np.ndarray
    """Of undeformed minus deformed height at the pixels [mm/unit], shape (p, pixels_x, pixels_y)."""
    force: np.ndarray
    """Of the force of the skin on the indenter [N/unit], shape (p, 3)."""
    taxel_force: np.ndarray
    """Of the normal force on each protrusion [N/unit], shape (p, taxels)."""
    taxel_closure: np.ndarray
    """Of the downward displacement of each protrusion's rim [mm/unit], shape (p, taxels)."""
    taxel_area: np.ndarray
    """Of each protrusion's contact area [mm^2/unit], shape (p, taxels), to some tens of per cent.

    By Hertz's A ~ (F (1 - nu^2) / E)^(2/3): the area itself is counted in whole hats and has no derivative."""
    error: float
    """Largest relative error of the linear solves up to here [1]."""


def sensitivities(
    model: SkinModel,
    request: PressRequest,
    parameters: Sequence[str],
    tolerance: float = TOLERANCE,
    passages: Iterable[Passage] | None = None,
    spreads: Sequence[float] | None = None,
) -> Iterator[tuple[float, Equilibrium, Sensitivity]]:
    """Yield the requested states of a press with their derivatives, in the order of its depths.

    Derivatives are those of the whole load path, at the load steps that are taken and with friction's history. Where a
    part of the skin just touches or just slips, they are one-sided.

    Args:
        model: The skin.
        request: The press.
        parameters: Names of parameters (`tacdata.skin.derivatives.parameter_names.known`).
        tolerance: Relative error of the linear solves [1].
        passages: The states of the press, if the model has solved them before; solved here if not given.
        spreads: Standard deviations of the parameters: errors are then over the largest change that one of them makes.
            None: over the change by each parameter alone.

    Raises:
        UsageError: If a parameter is not one of this press.
        SolveError: If a state or its derivatives are not found.
    """
    names = list(parameters)
    check(model.sensor, request.indenter, names)
    if model.sensor.contact.adhesion:
        raise SolveError(
            "derivatives of a press into a skin that sticks",
            "a sensor file without contact/adhesion",
            "sample whole presses (tacdata.skin.derivatives.uncertainty.sampled_spread)",
        )
    skin = model.skin
    press, reader = skin.placed(0, request), _Reader(model, request, names)
    touch = Pose(*(torch.as_tensor(value, device=model.device)[..., None] for value in (press.touch, press.turn)))
    changes = directions(model.sensor, request.indenter, names, press.conditions.on(model.device), touch)
    at_touch = _without_depth(names, changes)
    label = f"{request.indenter.shape} at ({request.x:g}, {request.y:g}) mm"
    weight = None if spreads is None else torch.tensor(spreads, dtype=torch.float64, device=model.device)
    newton = skin.newton([request])
    if model.device != "cpu":
        load_kernels(derivative_kernels(skin.body, newton.surfaces), model.device)
    derivatives = PathDerivatives(newton, skin.free, label, tolerance, _slack(model, names), weight)
    for passage in _passed(model, request) if passages is None else passages:
        for reached in passage.reached:
            derivatives.advance(reached, changes if derivatives.changes else at_touch)
        yield passage.depth, passage.state, reader.read(passage.state, derivatives, changes)


def _passed(model: SkinModel, request: PressRequest) -> Iterator[Passage]:
    """Solve a press; yield its states with all equilibria on the way.

    Raises:
        SolveError: If one is not found.
    """
    skin, recorder = model.skin, PathRecorder()
    batch = skin.batch([request], 1)
    for number, depth, state in batch.run([skin.placed(0, request)], skin.reader.states, recorder):
        if isinstance(state, SolveError):
            raise state
        yield Passage(depth, state, recorder.take(number))


def _slack(model: SkinModel, names: list[str]) -> Slack | None:
    """Return how held nodes move with each parameter: with the bonding alone."""
    if "bonding" not in names:
        return None
    bonding = Bonding(model.mesh, model.skin.fixed)
    own = torch.tensor([name == "bonding" for name in names], dtype=torch.float64, device=model.device)
    return lambda reaction: bonding.slack(reaction) * own


def _without_depth(names: list[str], changes: ConditionsChange) -> ConditionsChange:
    """Return the change of a path's start: a press whose depth is off by z still starts where it touches."""
    place = changes.pose.place.clone()
    place[2, [name == "z" for name in names]] = 0.0
    return replace(changes, pose=Pose(place, changes.pose.turn))


class _Reader:
    """From derivatives of displacements and tractions to those of the measured quantities."""

    def __init__(self, model: SkinModel, request: PressRequest, names: list[str]) -> None:
        self._model, self._names = model, names
        units = known(model.sensor, request.indenter)
        self._units = tuple(units[name] for name in names)
        grid = model.sensor.map
        self._raster = DepthRaster(model.mesh, grid.x, grid.y, grid.sampling, model.device)
        pixels = np.stack(np.meshgrid(grid.x, grid.y, indexing="ij"), axis=-1).reshape(-1, 2)
        self._height = model.skin.face.height(pixels).reshape(grid.shape)
        self._nodes = torch.as_tensor(model.mesh.nodes, device=model.device)

    def read(self, state: Equilibrium, derivatives: PathDerivatives, changes: ConditionsChange) -> Sensitivity:
        """Return the derivatives of one state."""
        taxel_force = self._taxel_force(derivatives)
        return Sensitivity(
            tuple(self._names),
            self._units,
            self._map(state, derivatives.du, changes.conditions.thickness),
            # Derivatives hold the force on the skin; the indenter feels the opposite.
            -derivatives.changes[0].force.sum(dim=0).T.cpu().numpy(),
            taxel_force,
            self._model.skin.reader.closure(derivatives.du).T.cpu().numpy(),
            self._area(state, taxel_force),
            derivatives.error,
        )

    def _map(self, state: Equilibrium, du: torch.Tensor, thickness: torch.Tensor) -> np.ndarray:
        """Return the derivative of the map: the skin moves under the pixels; a thicker slab has a higher face."""
        # Thickness scales heights of the slab alone, not the protrusions below z = 0.
        rise = self._nodes[:, 2].clamp_min(0.0)
        moves = du.clone()
        moves[:, 2] += rise[:, None] * thickness
        # The map has kinks between triangles. A step of the skin's own scale averages over them.
        step = _MAP_STEP / moves.abs().amax(dim=(0, 1)).clamp_min(1e-30)
        base = torch.as_tensor(state.displacement, device=du.device)[:, :, None]
        maps = self._raster.depth(torch.cat([base + step * moves, base - step * moves], dim=2))
        upper, lower = maps.cpu().numpy().reshape(2, -1, *maps.shape[1:])
        slope = (upper - lower) / (2 * step.cpu().numpy()[:, None, None])
        # The map counts from the undeformed face, which a thicker slab raises; pixels beside the skin have none.
        covered = self._raster.measure(base)[1][0].cpu().numpy() > 0
        return slope + covered * self._height * thickness.cpu().numpy()[:, None, None]

    def _taxel_force(self, derivatives: PathDerivatives) -> np.ndarray:
        if len(derivatives.changes) == 1:
            return np.zeros((len(self._names), self._model.sensor.taxels.count))
        return self._model.skin.reader.taxel_load(derivatives.changes[1].load).T.cpu().numpy()

    def _area(self, state: Equilibrium, taxel_force: np.ndarray) -> np.ndarray:
        """Return the derivative of the contact areas by Hertz's law, shape (p, taxels)."""
        material = self._model.sensor.material
        # Relative changes: of 1/E it is -dE/E, of 1 - nu^2 it is -2 nu dnu / (1 - nu^2).
        factors = {"youngs_modulus": 1 / material.youngs_modulus}
        factors["poisson_ratio"] = 2 * material.poisson_ratio / (1 - material.poisson_ratio**2)
        softer = np.array([factors.get(name, 0.0) for name in self._names])[:, None]
        loaded = state.taxel_force > 0
        share = np.where(loaded, taxel_force / np.where(loaded, state.taxel_force, 1.0), 0.0) - softer * loaded
        return 2 / 3 * state.taxel_area * share
