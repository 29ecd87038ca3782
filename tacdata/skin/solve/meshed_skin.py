"""A sensor's skin on one mesh, ready to be pressed: all that presses have in common and none of them changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
import torch

from tacdata.sensor import Sensor
from tacdata.skin.adhesions import load_adhesion_law
from tacdata.skin.contact.adhesion import AdhesiveSurface
from tacdata.skin.contact.contact_surface import SUBDIVISIONS, ContactSurface, face_quadrature
from tacdata.skin.contact.first_touch import rotation, touch
from tacdata.skin.contact.kernels import board_distance
from tacdata.skin.contact.mortar import Mortar
from tacdata.skin.elasticity.body import Elasticity
from tacdata.skin.linear.constraint_preconditioner import ConstraintPreconditioner
from tacdata.skin.linear.rest_stiffness import RestSolver, SparseRest, rest_solver
from tacdata.skin.materials import load_law
from tacdata.skin.member.conditions import Conditions, conditions, shape_number
from tacdata.skin.mesh import elements
from tacdata.skin.mesh.build import build_mesh
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.batch import Batch, PlacedPress
from tacdata.skin.solve.compilation import batch_kernels
from tacdata.skin.solve.equilibrium import StateReader
from tacdata.skin.solve.load_path import LoadPath
from tacdata.skin.solve.newton import Newton
from tacdata.skin.solve.second_attempt import SecondAttempt
from tacdata.skin.solve.settings import ModelSettings, SolverSettings
from tacdata.skin.surface.outer_face import OuterFace
from tacdata.skin.surface.protrusion_pressure import ProtrusionRaster
from tacdata.skin.surface.traction_map import TractionRaster
from tacdata.warp_runtime import load_kernels

_FIRST = 0.3
"""Longest first load step over the smallest radius of curvature of the shape [1]."""

_LIFT = 0.5
"""Longest load step upward over the range of adhesion [1]."""

_BACK = 3.0
"""Longest load step upward over that downward, without adhesion [1]: it starts from the way down.

In a slab held from below friction takes 2 to 7 % of the force. Against steps of 0.1 mm, those of 0.4 mm change the
force by 0.1 to 0.4 %."""

_JUMP = (200, 40)
"""Newton iterations per state, and without progress, that a jump into contact or off it may take."""


class MeshedSkin:
    """Mesh, body, board and rest stiffness of one sensor on one device; makes the batches that solve presses."""

    def __init__(
        self, sensor: Sensor, settings: ModelSettings, device: str = "cpu", mesh: SkinMesh | None = None
    ) -> None:
        """Mesh the skin (from the cache if possible); arguments as of `tacdata.skin.model.SkinModel`.

        Raises:
            SolveError: If the geometry cannot be meshed or nothing holds the skin.
        """
        self.sensor, self.settings, self.device = sensor, settings, device
        load_law(sensor.material.law)  # a name that is none is refused before seconds go into a mesh
        if sensor.contact.adhesion:
            load_adhesion_law(sensor.contact.adhesion.law)
        self.mesh = mesh or build_mesh(sensor, settings.mesh)
        self.fixed = self.mesh.fixed(sensor.contact.bonded, sensor.contact.rim_width)
        """Nodes that are held, shape (n,), bool."""
        # Far from incompressible, quadratic elements do not lock, and averages cost time.
        near = sensor.material.poisson_ratio >= settings.averaged_from
        self.averaged = near and load_law(sensor.material.law).splits_volume
        """Whether volume changes are averaged at the corners."""
        self._nodes = torch.as_tensor(self.mesh.nodes, device=device)
        self._held = torch.as_tensor(self.fixed, device=device)
        self.body = Elasticity(self.mesh, sensor.material.law, device, self.averaged)
        self.board = self._board() if sensor.contact.board and len(self.mesh.protrusions) else None
        """The board under the protrusions, if there is one."""
        self.reader = StateReader(self.mesh, sensor.taxels.count, self.board, device)
        self.face = OuterFace(self.mesh)
        self.tractions = TractionRaster(self.mesh, sensor.map)
        self.protrusions = ProtrusionRaster(self.mesh, sensor) if self.board else None

    @cached_property
    def rest(self) -> RestSolver:
        """The inverse of the stiffness at rest; costs seconds, once."""
        material = self.sensor.material
        # Three rows a node on the outer face, whose normals turn; on the flat board one, along z.
        faces = [(self.mesh.outer, np.eye(3))]
        if self.board:
            faces.append((self.mesh.protrusions, np.eye(3)[2:]))
        rows = sp.csr_matrix(sp.vstack([sp.kron(self._mortar(face).mean, axes) for face, axes in faces]))
        return rest_solver(self.mesh, material, self.fixed, rows, self.device, self.averaged)

    def forget(self) -> None:
        """Forget what presses have left: parts of the compliance, whose last bits depend on the presses before."""
        if isinstance(self.rest, SparseRest):
            self.rest.forget()

    @cached_property
    def conditions(self) -> Conditions:
        """The skin of one batch member, under nothing, on the CPU: a copy to a GPU for each press waits for the GPU."""
        return conditions(self.sensor.material, self.sensor.contact.friction)

    @property
    def free(self) -> torch.Tensor:
        """1 for nodes that are not held, else 0, shape (n, 1, 1), float64."""
        return torch.as_tensor(~self.fixed, device=self.device).to(torch.float64)[:, None, None]

    def placed(self, number: int, request: PressRequest) -> PlacedPress:
        """Return a press as a batch takes it: its load path, its indenter at depth 0, its conditions on the CPU."""
        adhesion = self.sensor.contact.adhesion
        path = LoadPath(
            request.depths,
            self.settings.step,
            f"{request.indenter.shape} at ({request.x:g}, {request.y:g}) mm",
            _FIRST * request.indenter.sharpest,
            _LIFT * adhesion.range if adhesion else _BACK * self.settings.step,
        )
        origin, conditions = touch(self.sensor, self.face, request), self._under(request)
        return PlacedPress(number, path, origin, rotation(request), conditions)

    def _under(self, request: PressRequest) -> Conditions:
        return self.conditions.pressed_by(request.indenter, self.device)

    def surfaces(self, requests: Sequence[PressRequest]) -> tuple[ContactSurface, ...]:
        """Return the contact surfaces of presses by the shapes of ``requests``: the outer face's, then the board's."""
        outer = torch.as_tensor(self.mesh.outer, device=self.device)
        shapes = {shape_number(request.indenter): request.indenter for request in requests}
        distances, contact = {n: shape.distance_function() for n, shape in shapes.items()}, self.sensor.contact
        arguments = self._nodes, outer, self._held, distances, contact.friction > 0, self.settings.activation
        if contact.adhesion:
            pressed = AdhesiveSurface(*arguments, self.settings.stick, contact.adhesion)
        else:
            pressed = ContactSurface(*arguments, self.settings.stick)
        return (pressed, self.board) if self.board else (pressed,)

    def newton(self, requests: Sequence[PressRequest], again: bool = False) -> Newton:
        """Return the solver of presses by the shapes of ``requests``; its preconditioner serves one batch at a time.

        ``again``: of presses that were given up.
        """
        surfaces = self.surfaces(requests)
        preconditioner = ConstraintPreconditioner(self.rest, surfaces, self.sensor.material.youngs_modulus)
        method = SecondAttempt if again else Newton
        return method(self.body, surfaces, self._held, preconditioner, settings=self._solver)

    def batch(self, requests: Sequence[PressRequest], capacity: int, again: bool = False) -> Batch:
        """Return an idle batch for presses by the shapes of ``requests``, so many at a time; `again`: see `newton`."""
        # The board just touches the tips of the undeformed protrusions.
        idle, floor = self._under(requests[0]).on(self.device), -self.sensor.skin.protrusion_tip
        newton = self.newton(requests, again)
        if self.device != "cpu":
            load_kernels(batch_kernels(self.body, newton.surfaces), self.device)
        return Batch(newton, idle, len(self.mesh.nodes), capacity, floor)

    def _board(self) -> ContactSurface:
        bumps = torch.as_tensor(self.mesh.protrusions, device=self.device)
        flat: Any = board_distance  # a Warp function, though its decorator's type does not say so
        return ContactSurface(
            self._nodes, bumps, self._held, {0.0: flat}, False, self.settings.activation, 0.0, flat=True
        )

    def _mortar(self, faces: np.ndarray) -> Mortar:
        weights, shapes = face_quadrature(self._nodes, torch.as_tensor(faces, device=self.device), SUBDIVISIONS)
        points = elements.triangle_hats(elements.triangle_quadrature(SUBDIVISIONS)[0])
        return Mortar(faces, weights.cpu().numpy(), shapes.cpu().numpy(), points, len(self.mesh.nodes), self.device)

    @property
    def _solver(self) -> SolverSettings:
        """The settings, with the forcing that the material needs and, where the skin sticks, the steps of a jump."""
        solver = self.settings.solver
        solver = replace(solver, forcing=solver.forcing_for(self.sensor.material))
        if self.sensor.contact.adhesion is None:
            return solver
        limit, patience = (max(a, b) for a, b in zip((solver.newton_limit, solver.patience), _JUMP, strict=True))
        return replace(solver, newton_limit=limit, patience=patience)
