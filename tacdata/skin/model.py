"""The skin model: presses go in, maps and forces along their paths come out."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from itertools import groupby
from typing import Any

import numpy as np
import torch

from tacdata import provenance
from tacdata.errors import SolveError
from tacdata.labels import PathSolution
from tacdata.sensor import Sensor
from tacdata.skin.adhesions import load_adhesion_law
from tacdata.skin.code_version import code_versions
from tacdata.skin.contact.adhesion import AdhesiveContact
from tacdata.skin.contact.contact import Contact, board_distance
from tacdata.skin.contact.first_touch import reach, rotation, touch
from tacdata.skin.contact.press_limits import check_press
from tacdata.skin.elasticity.body import Elasticity
from tacdata.skin.linear.contact_preconditioner import ContactPreconditioner
from tacdata.skin.linear.coupled_dofs import in_order
from tacdata.skin.linear.rest_stiffness import RestSolver, rest_solver
from tacdata.skin.materials import load_law
from tacdata.skin.member.conditions import Conditions, conditions
from tacdata.skin.mesh.build import MeshSettings, build_mesh
from tacdata.skin.mesh.coarser import blind_spot, companion_mesh, edge_ratio
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.batch import Batch, Members, Press
from tacdata.skin.solve.load_path import Walk
from tacdata.skin.solve.newton import Newton, SolverSettings
from tacdata.skin.solve.state import Gauge, State
from tacdata.skin.surface.outer_face import OuterFace
from tacdata.skin.validity import fineness
from tacdata.skin.validity.coarse_press import CoarsePress, press_coarsely
from tacdata.skin.validity.mesh_error import Figures, NumericalError, estimate
from tacdata.skin.validity.stable_strain import StableStrain

_ROWS = ("surface", "taxel_force", "taxel_closure", "force", "residual", "penetration")
"""What a path solution tells of every state."""

_TIP = 0.4
"""Height of a protrusion's tip region, over its radius, that the preconditioner knows as possible contact [1]. Contact
beyond costs iterations, not accuracy."""

_FIRST = 0.3
"""Longest first load step over the smallest radius of curvature of the shape [1]."""

_LIFT = 0.5
"""Longest load step upward over the range of adhesion [1]."""

_JUMP = (200, 40)
"""Newton iterations per state, and without progress, that a jump into contact or off it may take."""


@dataclass(frozen=True)
class ModelSettings:
    """Discretization and solver of the skin model."""

    mesh: MeshSettings = field(default_factory=MeshSettings)
    solver: SolverSettings = field(default_factory=SolverSettings)
    penalty: float = 1000.0
    """Contact penalty over Young's modulus [1/mm]."""
    stick: float = 30.0
    """Tangential stiffness of sticking points over Young's modulus [1/mm]."""
    step: float = 0.25
    """Longest load step [mm]."""
    averaged_from: float = 0.0
    """Poisson's ratio from which on volume changes are averaged at the corners
    (`tacdata.skin.elasticity.averaged_volume`) [1]:
    0 always, 0.5 never. Laws whose volumetric part is no term of its own take them at the points in any case."""
    error_estimate: bool = True
    """Whether `SkinModel.solve` also presses a coarser mesh, to say how far the mesh leaves the result off."""


class SkinModel:
    """A sensor's skin, meshed, factorized and ready for presses; costs seconds to build, so keep it."""

    def __init__(
        self, sensor: Sensor, settings: ModelSettings | None = None, device: str = "cpu", mesh: SkinMesh | None = None,
        companion: SkinMesh | None = None,
    ) -> None:
        """Mesh the skin (from the cache if possible).

        Args:
            sensor: Whose skin.
            settings: Discretization and solver.
            device: "cpu", or a card such as "cuda:0".
            mesh: Used in place of the settings' mesh.
            companion: Used in place of a coarser mesh by the settings, for the error estimate.

        Raises:
            SolveError: If the geometry cannot be meshed or nothing holds the skin.
        """
        self.sensor, self.settings, self.device = sensor, settings or ModelSettings(), device
        load_law(sensor.material.law)  # a name that is none is refused before seconds go into a mesh
        if sensor.contact.adhesion:
            load_adhesion_law(sensor.contact.adhesion.law)
        self.mesh = mesh or build_mesh(sensor, self.settings.mesh)
        self._companion_mesh = companion
        self._nodes = torch.as_tensor(self.mesh.nodes, device=device)
        self._fixed = self.mesh.fixed(sensor.contact.bonded, sensor.contact.rim_width)
        if not self._fixed.any():
            raise SolveError(
                "no bonded face holds the skin", "sides or bottom bonded", "set contact/bonded in the sensor file"
            )
        near = sensor.material.poisson_ratio >= self.settings.averaged_from
        self._averaged = near and load_law(sensor.material.law).splits_volume
        self._body = Elasticity(self.mesh, sensor.material.law, device, self._averaged)
        self._outer = torch.as_tensor(self.mesh.outer, device=device)
        self._bumps = torch.as_tensor(self.mesh.protrusions, device=device)
        self._on_board = sensor.contact.board and len(self._bumps) > 0
        self._gauge = Gauge(self.mesh, sensor.taxels.count, device)
        self._face = OuterFace(self.mesh)
        self._stable = StableStrain(self.mesh, sensor.material)
        self.remarks = self._stable.remarks
        """In words, what a user should know of this skin: where its material law is unstable."""
        self.last_run: dict[str, int] = {}
        """Newton and conjugate-gradient iterations of the last finished batch, for benchmarks."""

    @cached_property
    def _loadable(self) -> np.ndarray:
        """Degrees of freedom that contact may load: the outer face, all axes; the protrusions' tips, vertically."""
        outer = np.unique(self.mesh.outer)
        dofs = (3 * outer[~self._fixed[outer]][:, None] + np.arange(3)).ravel()
        if self._on_board:
            bumps = np.unique(self.mesh.protrusions)
            tips = bumps[self.mesh.nodes[bumps, 2] < (_TIP - 1) * self.sensor.skin.protrusion_radius]
            dofs = np.concatenate([dofs, 3 * tips[~self._fixed[tips]] + 2])
        return np.unique(dofs) if self.device == "cpu" else in_order(np.unique(dofs), self.mesh)

    @cached_property
    def _rest(self) -> RestSolver:
        material = self.sensor.material
        return rest_solver(self.mesh, material, self._fixed, self._loadable, self.device, self._averaged)

    @cached_property
    def companion(self) -> SkinModel | None:
        """The same skin on a coarser mesh; None if no coarser mesh can be made."""
        mesh = self._companion_mesh or companion_mesh(self.sensor, self.settings.mesh, self.mesh)
        settings = replace(self.settings, error_estimate=False)
        return SkinModel(self.sensor, settings, self.device, mesh) if mesh else None

    @cached_property
    def identity(self) -> dict[str, str]:
        """What decides a result: hashes of sensor, mesh and code, and the settings."""
        asked = self.settings.error_estimate
        coarse = {"companion": self.companion.mesh.content_hash} if asked and self.companion else {}
        return {
            "sensor": self.sensor.content_hash,
            "mesh": self.mesh.content_hash,
            **coarse,
            "settings": provenance.content_hash(asdict(self.settings)),
            **code_versions(),
        }

    @property
    def content_hash(self) -> str:
        """Hash of `identity`: the model's version."""
        return provenance.content_hash(self.identity)

    def _contacts(self, request: PressRequest) -> list[Contact]:
        penalty, stick = self.settings.penalty, self.settings.stick
        distance = request.indenter.distance_function()
        rough, adhesion = self.sensor.contact.friction > 0, self.sensor.contact.adhesion
        contacts = [
            AdhesiveContact(self._nodes, self._outer, distance, rough, penalty, stick, adhesion) if adhesion
            else Contact(self._nodes, self._outer, 1, distance, rough, penalty, stick)
        ]
        if self._on_board:
            flat: Any = board_distance
            contacts.append(Contact(self._nodes, self._bumps, 2, flat, False, penalty, 0.0))
        return contacts

    def _press(self, number: int, request: PressRequest) -> Press:
        adhesion = self.sensor.contact.adhesion
        walk = Walk(
            request.depths, self.settings.step, f"{request.indenter.shape} at ({request.x:g}, {request.y:g}) mm",
            _FIRST * request.indenter.sharpest, _LIFT * adhesion.range if adhesion else math.inf,
        )
        place, own = touch(self.sensor, self._face, request), self._skin.pressed_by(request.indenter)
        return Press(number, walk, place, rotation(request), own)

    @cached_property
    def _skin(self) -> Conditions:
        """The skin of one member, under nothing."""
        return conditions(self.sensor.material, self.sensor.contact.friction, device=self.device)

    @property
    def _solver(self) -> SolverSettings:
        """The settings; where the skin sticks, with the steps that a jump takes."""
        solver = self.settings.solver
        if self.sensor.contact.adhesion is None:
            return solver
        limit, patience = (max(a, b) for a, b in zip((solver.newton_limit, solver.patience), _JUMP, strict=True))
        return replace(solver, newton_limit=limit, patience=patience)

    def _batch(self, request: PressRequest, capacity: int) -> tuple[Batch, list[Contact]]:
        contacts = self._contacts(request)
        fixed = torch.as_tensor(self._fixed, device=self.device)
        loadable = torch.as_tensor(self._loadable, device=self.device)
        size, modulus = 3 * len(self.mesh.nodes), self.sensor.material.youngs_modulus
        preconditioner = ContactPreconditioner(self._rest, contacts, loadable, size, modulus)
        newton = Newton(self._body, contacts, fixed, preconditioner, self._solver)
        idle, floor = self._skin.pressed_by(request.indenter), -self.sensor.skin.protrusion_tip
        return Batch(newton, idle, len(self.mesh.nodes), capacity, floor), contacts

    def walk(
        self, requests: Iterable[PressRequest], capacity: int = 1, with_displacement: bool = True
    ) -> Iterator[tuple[int, float, State | SolveError]]:
        """Solve presses of one shape of indenter, many at a time.

        Args:
            requests: What to press.
            capacity: How many presses are in work at a time.
            with_displacement: Whether states hold displacements.

        Yields:
            The press's index, the depth [mm] and the state, as found; or, in its place, why the press was given up.
        """
        possible = list[tuple[int, PressRequest]]()
        for number, request in enumerate(requests):
            try:
                check_press(request, self.sensor)
                possible.append((number, request))
            except SolveError as error:
                yield number, 0.0, error
        if not possible:
            return
        batch, contacts = self._batch(possible[0][1], min(capacity, len(possible)))
        if self.device != "cpu":  # A card pays for columns that fall idle at the end: the longest paths come first.
            possible.sort(key=lambda one: -one[1].steps(self.settings.step))

        def collect(members: Members) -> list[State]:
            return self._gauge.states(members, contacts, with_displacement)

        def presses() -> Iterator[Press]:
            for number, request in possible:
                yield self._press(number, request)

        yield from batch.run(presses(), collect)
        self.last_run = {"ticks": batch.ticks, "cg": batch.cg}

    def states(self, request: PressRequest) -> Iterator[tuple[float, State]]:
        """Yield ``(depth, State)`` for each requested depth, solving the path between them in bounded steps.

        Raises:
            SolveError: If a state is not reached even with small steps, with the reason.
        """
        for _, depth, state in self.walk([request]):
            if isinstance(state, SolveError):
                raise state
            self._stable.check(depth, state.displacement)
            yield depth, state

    def solve(self, request: PressRequest) -> PathSolution:
        """Solve a press.

        Raises:
            SolveError: If the press is impossible or an equilibrium is not found.
        """
        [(_, solution)] = self.solve_many([request])
        if isinstance(solution, SolveError):
            raise solution
        return solution

    def solve_coarsely(self, requests: list[PressRequest], capacity: int = 1) -> list[CoarsePress | None]:
        """Solve the loading of presses on the companion: for `solve_many`, and to see which states a path needs.

        Args:
            requests: What to press.
            capacity: How many presses are in work at a time.

        Returns:
            One for each request; None where no error is estimated or there is no companion.
        """
        found: list[CoarsePress | None] = [None] * len(requests)
        if not (self.settings.error_estimate and self.companion):
            return found
        for numbers in _by_shape(requests):
            coarse = press_coarsely(self.companion, [requests[number] for number in numbers], capacity)
            for number, press in zip(numbers, coarse, strict=True):
                found[number] = press
        return found

    def solve_many(
        self, requests: list[PressRequest], capacity: int = 1, coarse: Sequence[CoarsePress | None] | None = None
    ) -> Iterator[tuple[int, PathSolution | SolveError]]:
        """Solve presses, many at a time; those of one shape of indenter share a batch.

        Args:
            requests: What to press.
            capacity: How many presses are in work at a time.
            coarse: What `solve_coarsely` said of them, perhaps at a part of the depths; solved here if not given.

        Yields:
            The press's index and its solution, as they are finished; or why it was given up.
        """
        for numbers in _by_shape(requests):
            chosen = [requests[number] for number in numbers]
            rows: dict[int, list[State]] = {number: [] for number in numbers}
            began = time.perf_counter()
            beside = [coarse[k] for k in numbers] if coarse else self.solve_coarsely(chosen, capacity)
            for index, _, state in self.walk(chosen, capacity):
                number = numbers[index]
                if isinstance(state, SolveError):
                    del rows[number]
                    yield number, state
                    continue
                rows[number].append(state)
                if len(rows[number]) == len(requests[number].depths):
                    seconds, began = time.perf_counter() - began, time.perf_counter()
                    yield number, self._answer(requests[number], rows.pop(number), beside[index], seconds)

    def figures(self, depths: Sequence[float], states: list[State]) -> Figures:
        """Return what states (with displacements) at depths [mm] say."""
        grid = self.sensor.map
        maps = [self._face.depth_map(grid.x, grid.y, state.displacement, grid.sampling) for state in states]
        return Figures(
            np.array(depths, dtype=float), np.array(maps).reshape(-1, *grid.shape),
            np.array([state.force for state in states]).reshape(-1, 3),
            np.array([state.taxel_force for state in states]).reshape(-1, self.sensor.taxels.count),
        )

    def numerical_error(
        self, request: PressRequest, fine: Figures, coarse: CoarsePress | None = None
    ) -> NumericalError:
        """Estimate the error that the mesh leaves in a press's states (`tacdata.skin.validity.mesh_error`).

        Args:
            request: The press.
            fine: What all of its states say.
            coarse: What a coarser mesh says of the loading; solved here if not given.
        """
        if self.companion is None:
            return estimate(self.sensor, fine, fine.first(0), 0.0, 1.0, "no coarser mesh can be made")
        if coarse is None:
            [coarse] = press_coarsely(self.companion, [request])
        half = max(reach(self.sensor, request))
        ratio = edge_ratio(self.mesh, self.companion.mesh)
        remarks = (blind_spot(self.mesh, self.companion.mesh) if self._on_board else "", coarse.remark)
        return estimate(self.sensor, fine, coarse.figures, half, ratio, "; ".join(filter(None, remarks)))

    def _answer(
        self, request: PressRequest, states: list[State], coarse: CoarsePress | None, seconds: float
    ) -> PathSolution | SolveError:
        try:
            return self._solution(request, states, coarse, seconds)
        except SolveError as error:
            return error

    def _solution(
        self, request: PressRequest, states: list[State], coarse: CoarsePress | None, seconds: float
    ) -> PathSolution:
        parameters = {
            "indenter": request.indenter.document, "x": request.x, "y": request.y, "yaw": request.yaw,
            **{name: tilt for name in ("tilt_x", "tilt_y") if (tilt := getattr(request, name))},
            "depths": list(request.depths), "settings": asdict(self.settings), "law": self.sensor.material.law,
            **({"adhesion": adhesion.document} if (adhesion := self.sensor.contact.adhesion) else {}),
            "device": self.device, "seconds": round(seconds, 3), "newton": sum(state.newton for state in states),
        }
        for depth, state in zip(request.depths, states, strict=True):
            self._stable.check(depth, state.displacement)
        fine = self.figures(request.depths, states)
        if self.settings.error_estimate:
            error = self.numerical_error(request, fine, coarse)
        else:
            error = NumericalError.none(fine)
        parameters["numerical"] = error.remark
        if blunt := fineness.remark(self.mesh, self.sensor, request):
            parameters["remarks"] = [blunt]
        return PathSolution(
            depth=fine.depth,
            surface=fine.surface,
            numerical=error.surface,
            taxel_force=fine.taxel_force,
            taxel_force_error=error.taxel_force,
            taxel_closure=np.array([state.taxel_closure for state in states]),
            taxel_area=np.array([state.taxel_area for state in states]),
            force=fine.force,
            force_error=error.force,
            residual=np.array([state.residual for state in states]),
            penetration=np.array([state.penetration for state in states]),
            provenance=provenance.stamp("tacdata.skin", self.identity, parameters),
        )


def _by_shape(requests: Sequence[PressRequest]) -> list[list[int]]:
    """Return the numbers of requests, those of one shape of indenter together."""
    order = sorted(range(len(requests)), key=lambda k: requests[k].indenter.shape)
    return [list(group) for _, group in groupby(order, key=lambda k: requests[k].indenter.shape)]
