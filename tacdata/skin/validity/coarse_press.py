"""The loading branch of presses on a coarser mesh: half of the estimate of the mesh's error."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

from tacdata.errors import SolveError
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.coarse_path import CoarsePath
from tacdata.skin.solve.configuration import Unknowns
from tacdata.skin.solve.passage import Passage, PathRecorder
from tacdata.skin.validity.mesh_error import Figures

if TYPE_CHECKING:
    from tacdata.skin.solve.equilibrium import Equilibrium


class PressSolver(Protocol):
    """The solver of presses: `tacdata.skin.model.SkinModel`."""

    def states_many(
        self, requests: list[PressRequest], capacity: int = 1, *, observe: PathRecorder | None = None
    ) -> Iterator[tuple[int, float, Equilibrium | SolveError]]:
        """As `SkinModel.states_many`."""
        ...

    def figures(self, request: PressRequest, depths: Sequence[float], states: list[Equilibrium]) -> Figures:
        """As `SkinModel.figures`."""
        ...


@dataclass(frozen=True)
class CoarsePress:
    """The loading branch of a press on the coarser mesh."""

    figures: Figures
    """Of the states reached."""
    remark: str
    """Missing part of the result; empty if it is complete."""
    passages: tuple[Passage, ...] = ()
    """The states with all equilibria on the way, if these were to be kept."""
    path: CoarsePath | None = None
    """The states, for starts of the finer mesh; None if none was reached."""


def loading(request: PressRequest) -> PressRequest:
    """Return a press of those depths alone that are deeper than all before."""
    deepest, depths = 0.0, []
    for depth in request.depths:
        if depth > deepest:
            depths.append(depth)
            deepest = depth
    return replace(request, depths=tuple(depths))


def press_coarsely(
    model: PressSolver, requests: list[PressRequest], capacity: int = 1, keep: bool = False
) -> list[CoarsePress]:
    """Solve the loading branches of presses on the coarser mesh.

    Args:
        model: Of the coarser mesh.
        requests: The presses as asked of the finer one.
        capacity: How many presses are in work at a time.
        keep: Whether to keep the passages, for derivatives.

    Returns:
        One for each request, as far as it was reached.
    """
    numbers = [k for k, request in enumerate(requests) if loading(request).depths]
    figures = [[model.figures(request, [], [])] for request in requests]
    remarks = [""] * len(requests)
    passages: list[list[Passage]] = [[] for _ in requests]
    reached: list[list[tuple[float, Unknowns]]] = [[] for _ in requests]
    recorder = PathRecorder()
    loadings = [loading(requests[k]) for k in numbers]
    for index, depth, state in model.states_many(loadings, capacity, observe=recorder):
        number = numbers[index]
        if isinstance(state, SolveError):
            # Deeper states then have no estimate of their own; the deepest one found is continued in proportion.
            remarks[number] = f"the coarser mesh gave up: {state.given}"
            continue
        passed = recorder.take(index)
        reached[number].append((depth, passed[-1].unknowns.single()))
        if keep:
            passages[number].append(Passage(depth, state, passed))
        try:
            figures[number].append(model.figures(requests[number], [depth], [state]))
        except SolveError as error:
            remarks[number] = f"the coarser mesh at {depth:g} mm: {error.given}"
    return [
        CoarsePress(Figures.joined(parts), remark, tuple(passage), CoarsePath.of(states))
        for parts, remark, passage, states in zip(figures, remarks, passages, reached, strict=True)
    ]
