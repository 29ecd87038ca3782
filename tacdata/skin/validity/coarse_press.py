"""The loading branch of presses on a coarser mesh: half of the estimate of the mesh's error."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

from tacdata.errors import SolveError
from tacdata.skin.press import PressRequest
from tacdata.skin.validity.mesh_error import Figures

if TYPE_CHECKING:
    from tacdata.skin.solve.equilibrium import Equilibrium


class PressSolver(Protocol):
    """What solves presses: `tacdata.skin.model.SkinModel`."""

    def states_many(
        self, requests: list[PressRequest], capacity: int = 1
    ) -> Iterator[tuple[int, float, Equilibrium | SolveError]]:
        """As `SkinModel.states_many`."""
        ...

    def figures(self, depths: Sequence[float], states: list[Equilibrium]) -> Figures:
        """As `SkinModel.figures`."""
        ...


@dataclass(frozen=True)
class CoarsePress:
    """The loading branch of a press on the coarser mesh."""

    figures: Figures
    """Of the states reached."""
    remark: str
    """What is missing, in words; empty if nothing."""


def loading(request: PressRequest) -> PressRequest:
    """Return a press of those depths alone that are deeper than all before."""
    deepest, depths = 0.0, []
    for depth in request.depths:
        if depth > deepest:
            depths.append(depth)
            deepest = depth
    return replace(request, depths=tuple(depths))


def press_coarsely(model: PressSolver, requests: list[PressRequest], capacity: int = 1) -> list[CoarsePress]:
    """Solve the loading branches of presses on the coarser mesh.

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
    for index, depth, state in model.states_many([loading(requests[k]) for k in numbers], capacity):
        number = numbers[index]
        if isinstance(state, SolveError):
            remarks[number] = f"the coarser mesh gave up: {state.given}"
            continue
        try:
            found[number].append(model.figures([depth], [state]))
        except SolveError as error:
            remarks[number] = f"the coarser mesh at {depth:g} mm: {error.given}"
    return [CoarsePress(Figures.joined(parts), remark) for parts, remark in zip(found, remarks, strict=True)]
