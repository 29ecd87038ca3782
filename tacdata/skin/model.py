"""The skin model: presses go in, maps and forces along their paths come out."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from functools import cached_property

import numpy as np

from tacdata import provenance
from tacdata.errors import SolveError
from tacdata.labels import PathSolution
from tacdata.sensor import Sensor
from tacdata.skin.code_version import model_identity
from tacdata.skin.contact.first_touch import reach, rise, rotation, touch
from tacdata.skin.contact.press_limits import check_press
from tacdata.skin.mesh.coarser import blind_spot, companion_mesh, edge_ratio
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.coarse_path import CoarseStart
from tacdata.skin.solve.equilibrium import Equilibrium
from tacdata.skin.solve.mesh_transfer import MeshTransfer
from tacdata.skin.solve.meshed_skin import MeshedSkin
from tacdata.skin.solve.passage import PathRecorder
from tacdata.skin.solve.settings import ModelSettings
from tacdata.skin.surface.pressed_shape import PressedShape, around, touching_share
from tacdata.skin.validity import fineness
from tacdata.skin.validity.coarse_press import CoarsePress, press_coarsely
from tacdata.skin.validity.mesh_error import Figures, NumericalError, estimate
from tacdata.skin.validity.stable_strain import StableStrain

__all__ = ["ModelSettings", "SkinModel"]

_ROUGHER = 4.0
"""Out-of-balance force that the companion's states may have over that of the mesh's [1].

With it the stated error of eight training presses changes by 0.04 % for maps, and by 1.5 % at most for forces. One
Newton step in eight is saved."""


class SkinModel:
    """A sensor's skin, meshed, factorized and ready for presses; costs seconds to build, so keep it.

    A request becomes a load path (`MeshedSkin.placed`). A batch solves it to states (`solve.batch`). The deformed outer
    face of each becomes a map (`surface`). A coarser mesh gives its numerical error (`validity`).

    >>> from tacdata.indenters.sphere import Sphere
    >>> from tacdata.sensor import default_sensor
    >>> from tacdata.skin.model import SkinModel
    >>> from tacdata.skin.press import PressRequest
    >>> model = SkinModel(default_sensor())
    >>> len(model.mesh.nodes), model.remarks
    (10196, ())
    >>> press = PressRequest(Sphere(3.0), x=1.0, y=0.0, yaw=0.0, depths=(0.4, 0.8))
    >>> solution = model.solve(press)  # doctest: +SKIP
    >>> solution.surface.shape, solution.force.shape  # doctest: +SKIP
    ((2, 35, 26), (2, 3))
    """

    def __init__(
        self,
        sensor: Sensor,
        settings: ModelSettings | None = None,
        device: str = "cpu",
        mesh: SkinMesh | None = None,
        companion: SkinMesh | None = None,
    ) -> None:
        """Mesh the skin (from the cache if possible).

        Args:
            sensor: Whose skin.
            settings: Discretization and solver.
            device: "cpu", or a GPU such as "cuda:0".
            mesh: Used in place of the settings' mesh.
            companion: Used in place of a coarser mesh by the settings, for the error estimate.

        Raises:
            SolveError: If the geometry cannot be meshed or nothing holds the skin.
            UsageError: If presses are to be solved alone, on a GPU.
        """
        self.sensor, self.settings, self.device = sensor, settings or ModelSettings(), device
        self.settings.check(device)
        self.skin = MeshedSkin(sensor, self.settings, device, mesh)
        self.mesh = self.skin.mesh
        self._companion_mesh = companion
        self._stable = StableStrain(self.mesh, sensor.material)
        self.remarks = self._stable.remarks
        """Remarks for the user: the strains at which the material law is unstable."""
        self.last_run: dict[str, int] = {}
        """Newton and conjugate-gradient iterations of the last finished batch, for benchmarks."""

    @cached_property
    def companion(self) -> SkinModel | None:
        """The same skin on a coarser mesh; None if no coarser mesh can be made."""
        mesh = self._companion_mesh or companion_mesh(self.sensor, self.settings.mesh, self.mesh)
        solver = replace(self.settings.solver, residual=_ROUGHER * self.settings.solver.residual)
        settings = replace(self.settings, error_estimate=False, solver=solver)
        return SkinModel(self.sensor, settings, self.device, mesh) if mesh else None

    @cached_property
    def identity(self) -> dict[str, str]:
        """Everything that decides a result (`model_identity`)."""
        companion = self.companion.mesh if self.settings.error_estimate and self.companion else None
        return model_identity(self.sensor, self.settings, self.mesh, companion)

    @property
    def content_hash(self) -> str:
        """Hash of `identity`: the model's version."""
        return provenance.content_hash(self.identity)

    def states_many(
        self,
        requests: Iterable[PressRequest],
        capacity: int = 1,
        with_displacement: bool = True,
        observe: PathRecorder | None = None,
        coarse: Sequence[CoarsePress | None] | None = None,
    ) -> Iterator[tuple[int, float, Equilibrium | SolveError]]:
        """Solve presses, many at a time; one that is given up is tried once more.

        Args:
            requests: The presses.
            capacity: How many presses are in work at a time.
            with_displacement: Whether states hold displacements.
            observe: Receives every equilibrium on the way, if given; then no press is tried again.
            coarse: The companion's results (`solve_coarsely`), from which load steps start.

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
        # Columns that fall idle at the end cost, above all on a GPU: the longest paths come first.
        possible.sort(key=lambda press: -press[1].steps(self.settings.step))
        starts = [self._start(press) for press in coarse or ()] or [None] * (1 + max(number for number, _ in possible))
        for group in [[press] for press in possible] if self.settings.alone else [possible]:
            if self.settings.alone:
                self.skin.forget()
            found, lost = Counter[int](), set[int]()
            for number, depth, state in self._walk(group, starts, capacity, with_displacement, observe):
                if isinstance(state, SolveError) and observe is None:
                    lost.add(number)
                else:
                    found[number] += 1
                    yield number, depth, state
            left = [press for press in group if press[0] in lost]
            for number, depth, state in self._walk(left, starts, capacity, with_displacement, again=True):
                # States that the first attempt has found are out already.
                found[number] -= 1
                if found[number] < 0 or isinstance(state, SolveError):
                    yield number, depth, state

    def _walk(
        self,
        presses: Sequence[tuple[int, PressRequest]],
        starts: Sequence[CoarseStart | None],
        capacity: int,
        with_displacement: bool,
        observe: PathRecorder | None = None,
        again: bool = False,
    ) -> Iterator[tuple[int, float, Equilibrium | SolveError]]:
        """Solve numbered presses as one batch; yields as `states_many`."""
        if not presses:
            return
        batch = self.skin.batch([request for _, request in presses], min(capacity, len(presses)), again)
        placed = (replace(self.skin.placed(number, request), coarse=starts[number]) for number, request in presses)
        yield from batch.run(placed, lambda found: self.skin.reader.states(found, with_displacement), observe)
        self.last_run = {"ticks": batch.newton_iterations, "cg": batch.cg}

    @cached_property
    def _transfer(self) -> MeshTransfer | None:
        """From the companion's unknowns to those on this mesh."""
        contacts = 2 if self.skin.board else 1
        return self.companion and MeshTransfer(self.companion.mesh, self.mesh, contacts, self.device)  # ty: ignore[invalid-explicit-return]

    def _start(self, coarse: CoarsePress | None) -> CoarseStart | None:
        return CoarseStart(coarse.path, self._transfer) if coarse and coarse.path and self._transfer else None

    def states(self, request: PressRequest) -> Iterator[tuple[float, Equilibrium]]:
        """Yield ``(depth, Equilibrium)`` for each requested depth, solving the path between them in bounded steps.

        Raises:
            SolveError: If a state is not reached even with small steps, with the reason.
        """
        for _, depth, state in self.states_many([request]):
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
            requests: The presses.
            capacity: How many presses are in work at a time.

        Returns:
            One for each request; None where no error is estimated or there is no companion. They keep their passages if
            the sensor file states spreads.
        """
        return self._coarsely(requests, capacity, keep=bool(self.sensor.uncertainty))

    def _coarsely(self, requests: list[PressRequest], capacity: int, keep: bool) -> list[CoarsePress | None]:
        if not (self.settings.error_estimate and self.companion):
            return [None] * len(requests)
        return list(press_coarsely(self.companion, requests, capacity, keep))

    def solve_many(
        self, requests: list[PressRequest], capacity: int = 1, coarse: Sequence[CoarsePress | None] | None = None
    ) -> Iterator[tuple[int, PathSolution | SolveError]]:
        """Solve presses, many at a time.

        Args:
            requests: The presses.
            capacity: How many presses are in work at a time.
            coarse: Results of `solve_coarsely`, perhaps at a part of the depths; solved here if not given.

        Yields:
            The press's index and its solution, as they are finished; or why it was given up.
        """
        rows: dict[int, list[Equilibrium]] = {number: [] for number in range(len(requests))}
        began = time.perf_counter()
        # Before the fine mesh, whose loading starts from its states.
        companions = coarse or self._coarsely(requests, capacity, keep=False)
        for number, _, state in self.states_many(requests, capacity, coarse=companions):
            if isinstance(state, SolveError):
                del rows[number]
                yield number, state
                continue
            rows[number].append(state)
            if len(rows[number]) == len(requests[number].depths):
                seconds, began = time.perf_counter() - began, time.perf_counter()
                yield number, self._answer(requests[number], rows.pop(number), companions[number], seconds)

    def figures(self, request: PressRequest, depths: Sequence[float], states: list[Equilibrium]) -> Figures:
        """Return maps and forces of a press's states (with displacements) at depths [mm].

        Maps are the indenter's surface where it touches (`tacdata.skin.surface.pressed_shape`).
        """
        grid, shapes = self.sensor.map, self.pressed_shapes(request, depths, states)
        displacements = [state.displacement for state in states]
        return Figures(
            np.array(depths, dtype=float),
            self.skin.face.pressed_maps(grid.x, grid.y, displacements, grid.sampling, shapes),
            np.array([state.force for state in states]).reshape(-1, 3),
            np.array([state.taxel_force for state in states]).reshape(-1, self.sensor.taxels.count),
        )

    def pressed_shapes(
        self, request: PressRequest, depths: Sequence[float], states: list[Equilibrium]
    ) -> list[PressedShape]:
        """Return the indenter as it presses in each state of a press at depths [mm]."""
        start, turn = touch(self.sensor, self.skin.face, request), rotation(request)
        risen, slots = rise(request.indenter, turn), self.skin.tractions.slots
        # Skin that hangs in a frame may sag deeper than the shape, so only touching nodes are bounded there (0021).
        borne = self.skin.board or "bottom" in self.sensor.contact.bonded
        shapes = []
        for depth, state in zip(depths, states, strict=True):
            place = start - np.array([0.0, 0.0, depth])
            touching = touching_share(state.traction, slots)
            wide = around(touching, slots) if borne else touching
            shapes.append(PressedShape(request.indenter, place, turn, float(place[2]) - risen, touching, wide))
        return shapes

    def numerical_error(
        self, request: PressRequest, fine: Figures, coarse: CoarsePress | None = None
    ) -> NumericalError:
        """Estimate the error that the mesh leaves in a press's states (`tacdata.skin.validity.mesh_error`).

        Args:
            request: The press.
            fine: Maps and forces of all of its states.
            coarse: Result of the loading on a coarser mesh; solved here if not given.
        """
        if self.companion is None:
            return estimate(self.sensor, fine, fine.first(0), 0.0, 1.0, "no coarser mesh can be made")
        if coarse is None:
            [coarse] = press_coarsely(self.companion, [request])
        half = max(reach(self.sensor, request))
        ratio = edge_ratio(self.mesh, self.companion.mesh)
        remarks = (blind_spot(self.mesh, self.companion.mesh) if self.skin.board else "", coarse.remark)
        return estimate(self.sensor, fine, coarse.figures, half, ratio, "; ".join(filter(None, remarks)))

    def _answer(
        self, request: PressRequest, states: list[Equilibrium], coarse: CoarsePress | None, seconds: float
    ) -> PathSolution | SolveError:
        try:
            return self._solution(request, states, coarse, seconds)
        except SolveError as error:
            return error

    def _solution(
        self, request: PressRequest, states: list[Equilibrium], coarse: CoarsePress | None, seconds: float
    ) -> PathSolution:
        parameters = {
            "indenter": request.indenter.document,
            "x": request.x,
            "y": request.y,
            "yaw": request.yaw,
            **{name: tilt for name in ("tilt_x", "tilt_y") if (tilt := getattr(request, name))},
            "depths": list(request.depths),
            "settings": asdict(self.settings),
            "law": self.sensor.material.law,
            **({"adhesion": adhesion.document} if (adhesion := self.sensor.contact.adhesion) else {}),
            "device": self.device,
            "seconds": round(seconds, 3),
            "newton": sum(state.newton for state in states),
        }
        for depth, state in zip(request.depths, states, strict=True):
            self._stable.check(depth, state.displacement)
        fine = self.figures(request, request.depths, states)
        if self.settings.error_estimate:
            error = self.numerical_error(request, fine, coarse)
        else:
            error = NumericalError.none(fine)
        parameters["numerical"] = error.remark
        if blunt := fineness.remark(self.mesh, self.sensor, request, reach(self.sensor, request)):
            parameters["remarks"] = [blunt]
        return PathSolution(
            depth=fine.depth,
            surface=fine.surface,
            traction=np.stack([self.skin.tractions.traction(s.displacement, s.traction) for s in states]),
            taxel_pressure=self._taxel_pressure(states),
            status_steps=np.array([float(state.changed) for state in states]),
            equilibrium_steps=np.array([float(state.newton - state.changed) for state in states]),
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

    def _taxel_pressure(self, states: list[Equilibrium]) -> np.ndarray | None:
        raster = self.skin.protrusions
        return raster and np.stack([raster.pressure(state.displacement, state.board_pressure) for state in states])  # ty: ignore[invalid-explicit-return]
