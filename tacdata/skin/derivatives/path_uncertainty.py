"""Standard deviations of a whole path, at a part of its cost: a coarser mesh, and the loading branch alone.

Standard deviations depend little on the mesh. For a sphere of 3 mm radius, 1 mm deep in the default skin, those on the
companion mesh differ by 9 to 13 % of their root mean square over the map, and by 1 to 3 % in the force. Those of
unloading differ from those of loading at the same depth by 1 %
(`pytest --long=all -s -k matter_little` measures it again).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tacdata.errors import SolveError
from tacdata.labels import PathSolution
from tacdata.sensor import Sensor
from tacdata.skin.derivatives.parameter_names import UNITS, known
from tacdata.skin.derivatives.press import sensitivities
from tacdata.skin.derivatives.uncertainty import Uncertainty, propagate, sampled_spread
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.passage import Passage
from tacdata.skin.validity.coarse_press import CoarsePress, loading

if TYPE_CHECKING:
    from tacdata.indenters import Indenter
    from tacdata.skin.model import SkinModel

_Found = list[tuple[float, Uncertainty]]
"""Depths [mm] and the standard deviations there."""

_STEEPER = 2.0
"""How many times steeper than the map itself, or than a slope of 0.5, a derivative by place may be [1]. Derivatives by
height and thickness are 1 under the tip and less elsewhere."""

_BESIDE = 0.02
"""Distance from a pixel's centre at which its slope is taken [mm]: a punch's edge is steep within part of a pixel."""

_TOLERANCE = 1e-2
"""Error of the derivatives' linear solves, over the largest change that one of the spreads makes [1].

It takes a fifth of the time of 1e-5 for each parameter. Against that, standard deviations differ by up to 0.7 % (maps),
1.1 % (forces) and 0.5 % (protrusions' loads) of their root mean square, for two spheres and a cylinder. The mesh makes
more of a difference."""

_SAMPLES = 12
"""Presses drawn where derivatives are of no use; they tell a standard deviation to 20 %."""

_NAMES = {
    "surface": "uncertainty",
    "force": "force_uncertainty",
    "taxel_force": "taxel_force_uncertainty",
    "taxel_closure": "taxel_closure_uncertainty",
}
"""Fields of `Uncertainty` -> those of `PathSolution`."""


def spreads_of(sensor: Sensor, indenter: Indenter) -> dict[str, float]:
    """Return the spreads of a sensor file that a press has.

    None of 0, none of sizes that its indenter lacks, and none of a friction of 0, by which there is no derivative.
    """
    has = set(known(sensor, indenter)) - (set() if sensor.contact.friction else {"friction"})
    return {name: value for name, value in sensor.uncertainty.items() if value > 0 and name in has}


def with_uncertainty(
    model: SkinModel, request: PressRequest, solution: PathSolution, coarse: CoarsePress | None = None
) -> PathSolution:
    """Return a solution with the standard deviations that the sensor file's spreads give it.

    Three ways are tried in turn: to first order on the companion, to first order on the mesh itself, and sampled on the
    companion. A sharp cone may need the second, a punch's edge the third. Without spreads, or where no way succeeds,
    the solution is unchanged but for a remark in its provenance.

    Args:
        model: That solved it; its companion is taken where there is one.
        request: The press.
        solution: Its states, at the depths of ``request`` or more.
        coarse: The companion's result of the press (`SkinModel.solve_coarsely`); its states are taken from there if
            it kept them.
    """
    spreads = spreads_of(model.sensor, request.indenter)
    if not spreads or not loading(request).depths:
        return _noted(solution, {"spreads": spreads, "remark": "no spreads stated" if not spreads else "no contact"})
    remarks = []
    cheapest = model.companion or model
    # A path that ends early is tried again alone: its error then gives the reason.
    passages = coarse.passages if coarse and len(coarse.passages) == len(loading(request).depths) else None
    ways: list[tuple[str, SkinModel, Callable[..., _Found]]] = [
        ("first_order", cheapest, lambda on, press, own: _first_order(on, press, own, passages)),
        ("first_order", model, _first_order),
        ("sampled", cheapest, _sampled),
    ]
    for name, on, way in ways:
        try:
            spread = way(on, loading(request), spreads)
        except SolveError as error:
            remarks.append(f"{name} on {len(on.mesh.nodes)} nodes: {error.given}")
            continue
        how = {"mesh": on.mesh.content_hash, "method": name, "remark": "; ".join(remarks)}
        return _noted(replace(solution, **_along(solution.depth, spread)), {"spreads": spreads, **how})
    return _noted(solution, {"spreads": spreads, "remark": "not found: " + "; ".join(remarks)})


def _first_order(
    model: SkinModel, request: PressRequest, spreads: dict[str, float], passages: tuple[Passage, ...] | None = None
) -> _Found:
    """Return depths and standard deviations by derivatives; ``passages`` as of `sensitivities`.

    Raises:
        SolveError: If they are not found, or are much steeper than the map. Where a sharp tip is about to slip on a
            coarse mesh, they hold for next to no change.
    """
    spreads_found = []
    found_by = sensitivities(model, request, list(spreads), _TOLERANCE, passages, list(spreads.values()))
    for depth, state, sensitivity in found_by:
        steep = _STEEPER * max(_slope(model, state.displacement), 0.5)
        # Where the map changes by more than the geometry allows, a contact is about to jump: no first order holds
        # there.
        limits = {"x": steep, "y": steep, "z": _STEEPER, "thickness": _STEEPER}
        for name, limit in limits.items():
            if name not in spreads or depth <= 0:
                continue
            steepest = float(np.abs(sensitivity.surface[sensitivity.parameters.index(name)]).max())
            if steepest > limit:
                raise SolveError(
                    f"at {depth:g} mm the map changes by {steepest:.1f} mm a mm of {name}",
                    f"at most {limit:.1f}",
                    "sample whole presses",
                )
        spreads_found.append((depth, propagate(sensitivity, spreads)))
    return spreads_found


def _slope(model: SkinModel, displacement: np.ndarray) -> float:
    """Return the largest slope of the deformed face along x or y at a pixel [1], there and not from pixel to pixel."""
    grid = model.sensor.map

    def height(x: float, y: float) -> np.ndarray:
        return model.skin.face.depth_map(grid.x + x, grid.y + y, displacement)

    slopes = [height(_BESIDE, 0.0) - height(-_BESIDE, 0.0), height(0.0, _BESIDE) - height(0.0, -_BESIDE)]
    return float(np.abs(slopes).max()) / (2 * _BESIDE)


def _sampled(model: SkinModel, request: PressRequest, spreads: dict[str, float]) -> _Found:
    """Return depths and standard deviations among whole presses."""
    return sampled_spread(model, request, spreads, _SAMPLES, capacity=4)


def _along(depth: np.ndarray, spread: _Found) -> dict[str, np.ndarray]:
    """Return the standard deviations at all states [mm or N], between those of loading linearly in depth, 0 at 0."""
    # Unloading states take the deviations of loading at the same depth: they differ by friction alone.
    known_at = np.array([0.0, *(at for at, _ in spread)])
    upper = np.clip(np.searchsorted(known_at, depth - 1e-9), 1, len(known_at) - 1)
    share = np.clip((depth - known_at[upper - 1]) / (known_at[upper] - known_at[upper - 1]), 0.0, 1.0)
    result = {}
    for field in fields(Uncertainty):
        values = np.array([getattr(part, field.name) for _, part in spread])
        values = np.concatenate([np.zeros_like(values[:1]), values])
        weight = share.reshape(-1, *[1] * (values.ndim - 1))
        result[_NAMES[field.name]] = (1 - weight) * values[upper - 1] + weight * values[upper]
    return result


def _noted(solution: PathSolution, what: dict[str, Any]) -> PathSolution:
    units = {name: UNITS.get(name, "1") for name in what["spreads"]}
    return replace(solution, provenance={**solution.provenance, "uncertainty": {**what, "units": units}})
