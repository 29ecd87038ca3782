"""A coarser mesh of the same skin, and what presses say on it: half of the estimate of the numerical error."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from tacdata.errors import SolveError
from tacdata.sensor import Sensor
from tacdata.skin.mesh import SkinMesh
from tacdata.skin.mesher import MeshSettings, build_mesh
from tacdata.skin.numerical_error import Figures
from tacdata.skin.press import PressRequest

if TYPE_CHECKING:
    from tacdata.skin.state import State

RATIOS = (1.5, 2.0, 2.6)
"""Ratios of edge lengths that are tried, in this order, until the mesh is really coarser [1]."""

LEAST_RATIO = 1.3
"""Ratio of edge lengths, as counted, from which a mesh is coarser [1]; at 1.3 it costs half, at 1.5 a third."""


class Walker(Protocol):
    """What solves presses: `tacdata.skin.model.SkinModel`."""

    def walk(
        self, requests: list[PressRequest], capacity: int = 1
    ) -> Iterator[tuple[int, float, State | SolveError]]:
        """As `SkinModel.walk`."""
        ...

    def figures(self, depths: Sequence[float], states: list[State]) -> Figures:
        """As `SkinModel.figures`."""
        ...


@dataclass(frozen=True)
class CoarsePress:
    """The loading branch of a press on the coarser mesh."""

    figures: Figures
    """Of the states reached."""
    remark: str
    """What is missing, in words; empty if nothing."""


def coarser(settings: MeshSettings, ratio: float) -> MeshSettings:
    """Return settings whose edge lengths are ``ratio`` [1] times as long."""
    focus = settings.focus and (*settings.focus[:3], ratio * settings.focus[3], *settings.focus[4:])
    return replace(
        settings, outer=ratio * settings.outer, interior=ratio * settings.interior,
        protrusion=ratio * settings.protrusion, tip=settings.tip and ratio * settings.tip, focus=focus,
    )


def edge_ratio(fine: SkinMesh, coarse: SkinMesh) -> float:
    """Return the edge length of a coarser mesh over that of a finer one [1], by the triangles of their outer faces."""
    return float(np.sqrt(len(fine.outer) / len(coarse.outer)))


def blind_spot(fine: SkinMesh, coarse: SkinMesh) -> str:
    """Say where a coarser mesh is not coarser, so that the estimate misses the error made there; empty if nowhere."""
    if not len(fine.protrusions) or not len(coarse.protrusions):
        return ""
    ratio = np.sqrt(len(fine.protrusions) / len(coarse.protrusions))
    if ratio >= LEAST_RATIO:
        return ""
    return f"blind to the mesh of the protrusions, whose edges are only {ratio:.2f} times as long on the coarser mesh"


def companion_mesh(sensor: Sensor, settings: MeshSettings, fine: SkinMesh) -> SkinMesh | None:
    """Return a mesh of a sensor that is coarser than ``fine``, from `build_mesh`; None if there is none.

    The mesher keeps the geometry's own vertices and so need not follow the edge length asked for: the first of `RATIOS`
    is taken whose mesh is coarser by `LEAST_RATIO`, else the coarsest.
    """
    found: list[SkinMesh] = []
    for ratio in RATIOS:
        try:
            found.append(build_mesh(sensor, coarser(settings, ratio)))
        except SolveError:
            break
        if edge_ratio(fine, found[-1]) >= LEAST_RATIO:
            return found[-1]
    best = min(found, key=lambda mesh: len(mesh.outer), default=None)
    return best if best is not None and len(best.outer) < len(fine.outer) else None


def loading(request: PressRequest) -> PressRequest:
    """Return a press of those depths alone that are deeper than all before."""
    deepest, depths = 0.0, []
    for depth in request.depths:
        if depth > deepest:
            depths.append(depth)
            deepest = depth
    return replace(request, depths=tuple(depths))


def press_coarsely(model: Walker, requests: list[PressRequest], capacity: int = 1) -> list[CoarsePress]:
    """Solve the loading branches of presses of one shape of indenter on the coarser mesh.

    Args:
        model: Of the coarser mesh.
        requests: The presses as asked of the finer one.
        capacity: How many presses are in work at a time.

    Returns:
        One for each request, as far as it was reached.
    """
    numbers = [k for k, request in enumerate(requests) if loading(request).depths]
    found = [[model.figures([], [])] for _ in requests]
    remarks = [""] * len(requests)
    for index, depth, state in model.walk([loading(requests[k]) for k in numbers], capacity):
        number = numbers[index]
        if isinstance(state, SolveError):
            remarks[number] = f"the coarser mesh gave up: {state.given}"
            continue
        try:
            found[number].append(model.figures([depth], [state]))
        except SolveError as error:
            remarks[number] = f"the coarser mesh at {depth:g} mm: {error.given}"
    return [CoarsePress(Figures.joined(parts), remark) for parts, remark in zip(found, remarks, strict=True)]
