"""The skin model: a press goes in, maps and forces along its path come out."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import torch

from tacdata import provenance
from tacdata.errors import SolveError
from tacdata.indenters import Indenter
from tacdata.labels import PathSolution
from tacdata.sensor import Sensor
from tacdata.skin.compliance import Compliance, ContactPreconditioner
from tacdata.skin.contact import Contact, board_distance, face_quadrature
from tacdata.skin.elasticity import Elasticity
from tacdata.skin.equilibrium import Equilibrium, Outcome, SolverSettings
from tacdata.skin.mesh import SkinMesh
from tacdata.skin.mesher import MeshSettings, build_mesh
from tacdata.skin.preconditioner import RestFactor, rest_stiffness
from tacdata.skin.raster import OuterFace

_REACH, _MARGIN = 0.6, 0.1
"""Nodes of the outer face whose height under the indenter is below this share of the depth, and this much [mm], are
candidates for contact: a sphere touches to half its depth (Hertz). Contact beyond costs iterations, not accuracy."""

_ROWS = ("surface", "taxel_force", "taxel_closure", "force", "residual", "penetration")
"""What a path solution tells of every state."""

_TIP = 0.4
"""Height of a protrusion's tip region, over its radius, whose nodes are candidates for contact with the board [1]."""


@dataclass(frozen=True)
class PressRequest:
    """One press: an indenter goes down to a depth and comes back."""

    indenter: Indenter
    """What presses."""
    x: float
    """Place of its lowest point [mm]."""
    y: float
    """Place of its lowest point [mm]."""
    yaw: float
    """Rotation about z [deg]."""
    depths: tuple[float, ...]
    """Depths of the states to report [mm]: 0, rising to the deepest, then falling to 0 (or ending at the deepest)."""

    def check(self, sensor: Sensor) -> None:
        """Refuse a press that misses the skin or goes through it.

        Raises:
            SolveError: Saying which.
        """
        skin = sensor.skin
        if not self.depths or not np.all(np.isfinite(self.depths)) or min(self.depths) < 0:
            raise SolveError(f"depths {self.depths} mm", "one or more depths of 0 mm or more", "correct the press")
        if max(self.depths) >= skin.thickness:
            raise SolveError(
                f"depth {max(self.depths):g} mm in a skin {skin.thickness:g} mm thick",
                f"less than {skin.thickness:g} mm", "reduce the depth",
            )
        if not np.all(np.isfinite([self.x, self.y, self.yaw])):
            raise SolveError(
                f"press at ({self.x}, {self.y}) mm, yaw {self.yaw} deg", "finite numbers", "correct the press"
            )
        if abs(self.x) > skin.size_x / 2 or abs(self.y) > skin.size_y / 2:
            raise SolveError(
                f"press at ({self.x:g}, {self.y:g}) mm, the skin spans {skin.size_x:g} x {skin.size_y:g} mm",
                "a place on the skin", "move the press",
            )
        reach = self.indenter.footprint(max(self.depths), self.yaw)
        over = [abs(place) + half - size / 2 for place, half, size in
                zip((self.x, self.y), reach, (skin.size_x, skin.size_y), strict=True)]
        if "sides" in sensor.contact.bonded and max(over) > 0 and max(self.depths) > 0:
            raise SolveError(
                f"{self.indenter.shape} at ({self.x:g}, {self.y:g}) mm, {max(self.depths):g} mm deep, reaches "
                f"{max(over):.2f} mm over the rim, which is bonded to the frame",
                f"a footprint of {reach[0]:.2f} x {reach[1]:.2f} mm around the press inside the rim",
                "move the press inward, press less deep, or describe another bonding in the sensor file",
            )


@dataclass(frozen=True)
class ModelSettings:
    """Discretization and solver of the skin model."""

    mesh: MeshSettings = field(default_factory=MeshSettings)
    solver: SolverSettings = field(default_factory=SolverSettings)
    penalty: float = 3000.0
    """Contact penalty over Young's modulus [1/mm]."""
    stick: float = 100.0
    """Tangential stiffness of sticking points over Young's modulus [1/mm]."""
    step: float = 0.25
    """Longest load step [mm]."""


@dataclass(frozen=True)
class State:
    """One equilibrium in full."""

    displacement: np.ndarray
    """Nodal displacements [mm], shape (nodes, 3)."""
    outcome: Outcome
    force: np.ndarray
    """Force of the skin on the indenter [N], shape (3,)."""
    taxel_force: np.ndarray
    """Normal force on each protrusion [N], shape (taxels,)."""
    taxel_closure: np.ndarray
    """Mean downward displacement of each protrusion's rim [mm], shape (taxels,)."""


class SkinModel:
    """A sensor's skin, meshed, factorized and ready for presses; costs seconds to build, so keep it."""

    def __init__(
        self, sensor: Sensor, settings: ModelSettings | None = None, device: str = "cpu", mesh: SkinMesh | None = None
    ) -> None:
        """Mesh the skin (from the cache if possible) and factorize its rest stiffness.

        Raises:
            SolveError: If the geometry cannot be meshed or nothing holds the skin.
        """
        self.sensor, self.settings, self.device = sensor, settings or ModelSettings(), device
        self.mesh = mesh or build_mesh(sensor, self.settings.mesh)
        self._nodes = torch.as_tensor(self.mesh.nodes, device=device)
        self._fixed = self.mesh.fixed(sensor.contact.bonded)
        if not self._fixed.any():
            raise SolveError(
                "no bonded face holds the skin", "sides or bottom bonded", "set contact/bonded in the sensor file"
            )
        self._body = Elasticity(self.mesh, sensor.material, device)
        self._outer = torch.as_tensor(self.mesh.outer, device=device)
        self._bumps = torch.as_tensor(self.mesh.protrusions, device=device)
        self._taxel = torch.as_tensor(self.mesh.protrusion_taxel, device=device).long()
        self._face = OuterFace(self.mesh)

    @cached_property
    def _factor(self) -> RestFactor:
        free = np.flatnonzero(~np.repeat(self._fixed, 3))
        return RestFactor(rest_stiffness(self.mesh, self.sensor.material), free)

    @cached_property
    def identity(self) -> dict[str, str]:
        """What decides a result: hashes of sensor, mesh and code, and the settings."""
        return {
            "sensor": self.sensor.content_hash,
            "mesh": self.mesh.content_hash,
            "settings": provenance.content_hash(asdict(self.settings)),
            "code": provenance.source_hash("tacdata.skin"),
            "indenters": provenance.source_hash("tacdata.indenters"),
        }

    @property
    def content_hash(self) -> str:
        """Hash of `identity`: the model's version."""
        return provenance.content_hash(self.identity)

    def smallest_volume_ratio(self, u: torch.Tensor) -> torch.Tensor:
        """Return the smallest det F [1], shape (b,), of displacements [mm], shape (b, n, 3)."""
        return self._body.internal_force(u)[1]

    def closure(self, u: np.ndarray) -> np.ndarray:
        """Return the mean downward displacement of each protrusion's rim [mm], shape (taxels,), from ``u`` (n, 3)."""
        count = self.sensor.taxels.count
        faces = self.mesh.protrusions
        taxel = np.repeat(self.mesh.protrusion_taxel, faces.shape[1])
        pairs = np.unique(np.stack([faces.ravel(), taxel]), axis=1)
        node, taxel = pairs[:, np.abs(self.mesh.nodes[pairs[0], 2]) < 1e-9]
        total = np.bincount(taxel, weights=-u[node, 2], minlength=count)
        return total / np.maximum(np.bincount(taxel, minlength=count), 1)

    def _contacts(self, indenter: Indenter) -> list[Contact]:
        modulus = self.sensor.material.youngs_modulus
        penalty, stick = self.settings.penalty * modulus, self.settings.stick * modulus
        weights, shapes = face_quadrature(self._nodes, self._outer, 1)
        contacts = [
            Contact(
                self._nodes, self._outer, weights, shapes, indenter.distance_function(), indenter.parameters,
                self.sensor.contact.friction, penalty, stick,
            )
        ]
        if self.sensor.contact.board and len(self._bumps):
            weights, shapes = face_quadrature(self._nodes, self._bumps, 2)
            contacts.append(
                Contact(
                    self._nodes, self._bumps, weights, shapes,
                    board_distance,  # pyright: ignore[reportArgumentType]
                    (), 0.0, penalty, 0.0,
                )
            )
        return contacts

    def _poses(self, request: PressRequest, depth: float) -> list[torch.Tensor]:
        skin = self.sensor.skin
        tip = [request.x, request.y, skin.thickness - depth, np.radians(request.yaw)]
        poses = [tip, [0.0, 0.0, -skin.protrusion_radius, 0.0]]
        return [torch.tensor([pose], dtype=torch.float64, device=self.device) for pose in poses]

    @cached_property
    def _board_compliance(self) -> Compliance:
        """Of the protrusions' tips, vertically: the same for every press."""
        radius = self.sensor.skin.protrusion_radius
        nodes = np.unique(self.mesh.protrusions)
        tips = nodes[(self.mesh.nodes[nodes, 2] < -(1 - _TIP) * radius) & ~self._fixed[nodes]]
        return Compliance.of(self._factor, len(self.mesh.nodes), 3 * tips + 2)

    def _compliance(self, request: PressRequest) -> Compliance:
        """Of the outer nodes that the indenter can reach, in all directions, and of the protrusions' tips."""
        outer = np.unique(self.mesh.outer)
        c, s = np.cos(np.radians(request.yaw)), np.sin(np.radians(request.yaw))
        dx, dy = self.mesh.nodes[outer, 0] - request.x, self.mesh.nodes[outer, 1] - request.y
        height = request.indenter.profile(c * dx + s * dy, -s * dx + c * dy)
        reach = outer[height < _REACH * max(request.depths) + _MARGIN]
        faces = np.unique(self.mesh.outer[np.isin(self.mesh.outer, reach).any(axis=1)])
        nodes = faces[~self._fixed[faces]]
        dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
        own = Compliance.of(self._factor, len(self.mesh.nodes), dofs)
        return own.join(self._board_compliance) if self.sensor.contact.board else own

    def states(self, request: PressRequest):
        """Yield ``(depth, State)`` for each requested depth, solving the path between them in bounded steps.

        Raises:
            SolveError: If a state is not reached even with small steps, with the reason.
        """
        request.check(self.sensor)
        contacts = self._contacts(request.indenter)
        preconditioner = ContactPreconditioner(self._factor, self._compliance(request), len(self.mesh.nodes))
        solver = Equilibrium(
            self._body, contacts, torch.as_tensor(self._fixed, device=self.device), preconditioner, self.settings.solver
        )
        path = _Path(self, solver, contacts, request)
        for depth in request.depths:
            yield depth, path.advance(depth)

    def solve(self, request: PressRequest) -> PathSolution:
        """Solve a press.

        Raises:
            SolveError: If the press is impossible or an equilibrium is not found.
        """
        began = time.perf_counter()
        grid = self.sensor.map
        rows: dict[str, list[Any]] = {name: [] for name in _ROWS}
        newton = cg = 0
        for _, state in self.states(request):
            rows["surface"].append(self._face.depth_map(grid.x, grid.y, state.displacement))
            rows["force"].append(state.force)
            rows["taxel_force"].append(state.taxel_force)
            rows["taxel_closure"].append(state.taxel_closure)
            rows["residual"].append(float(state.outcome.residual[0]))
            rows["penetration"].append(float(state.outcome.penetration[0]))
            newton, cg = newton + state.outcome.newton, cg + state.outcome.cg
        parameters = {
            "indenter": request.indenter.document, "x": request.x, "y": request.y, "yaw": request.yaw,
            "depths": list(request.depths), "settings": asdict(self.settings), "law": self.sensor.material.law,
            "device": self.device, "seconds": round(time.perf_counter() - began, 3), "newton": newton, "cg": cg,
        }
        return PathSolution(
            depth=np.array(request.depths),
            provenance=provenance.stamp("tacdata.skin", self.identity, parameters),
            **{name: np.array(values) for name, values in rows.items()},
        )


class _Path:
    """The load path of one press: displacements and contact history, advanced step by step."""

    def __init__(self, model: SkinModel, solver: Equilibrium, contacts: list[Contact], request: PressRequest) -> None:
        self._model, self._solver, self._contacts, self._request = model, solver, contacts, request
        self._depth, self._step = 0.0, 0.0
        self._u = torch.zeros(1, *model.mesh.nodes.shape, dtype=torch.float64, device=model.device)
        self._rate = torch.zeros_like(self._u)
        self._loaded = [(0.0, self._u)]
        poses = model._poses(request, 0.0)
        self._states = [contact.start(pose) for contact, pose in zip(contacts, poses, strict=False)]
        for contact, state, pose in zip(contacts, self._states, poses, strict=False):
            contact.add_force(self._u, pose, state, torch.zeros_like(self._u))
            contact.accept(state, pose)
        self._outcome: Outcome | None = None

    def advance(self, target: float) -> State:
        """Go to a depth [mm] in bounded steps, halved where no equilibrium is found."""
        step = self._model.settings.step
        if target == 0.0 and self._outcome is None:
            self._try(0.0)
        while abs(target - self._depth) > 1e-12:
            wanted = float(np.clip(target - self._depth, -step, step))
            if self._try(self._depth + wanted):
                continue
            step = abs(wanted) / 2
            if step < 0.01:
                reason = self._outcome.reason[0] if self._outcome else "no attempt"
                raise SolveError(
                    f"{self._request.indenter.shape} at ({self._request.x:g}, {self._request.y:g}) mm: no equilibrium "
                    f"beyond depth {self._depth:.3f} mm; {reason}",
                    "a residual and penetration within the solver settings",
                    "reduce the depth, use a finer mesh, or a blunter indenter",
                )
        return self._state()

    def _guess(self, depth: float) -> torch.Tensor:
        """Return where to start [mm], (1, n, 3): along the last rate, or on the way back where loading passed."""
        if depth >= self._loaded[-1][0]:
            return self._u + self._rate * (depth - self._depth)
        return self._on_loading(depth) + (self._u - self._on_loading(self._depth))

    def _on_loading(self, depth: float) -> torch.Tensor:
        """Interpolate the states passed while loading, [mm] (1, n, 3)."""
        depths = [passed for passed, _ in self._loaded]
        after = min(max(int(np.searchsorted(depths, depth)), 1), len(depths) - 1)
        (low, u_low), (high, u_high) = self._loaded[after - 1], self._loaded[after]
        share = (depth - low) / (high - low)
        return u_low + share * (u_high - u_low)

    def _try(self, depth: float) -> bool:
        """Attempt one step; keeps the history unchanged where it fails."""
        model = self._model
        poses = model._poses(self._request, depth)[: len(self._contacts)]
        saved = [state.multiplier.clone() for state in self._states]
        start = self._guess(depth)
        if float(model.smallest_volume_ratio(start)) < 0.3:
            start = self._u
        judged = torch.tensor([max(depth, 0.1)], dtype=torch.float64, device=model.device)
        u, outcome = self._solver.solve(start, poses, self._states, judged)
        self._outcome = outcome
        if not bool(outcome.converged.all()):
            for state, multiplier in zip(self._states, saved, strict=True):
                state.multiplier.copy_(multiplier)
            return False
        if depth != self._depth:
            turning = (depth - self._depth) * self._step < 0
            self._rate = torch.zeros_like(u) if turning else (u - self._u) / (depth - self._depth)
            self._step = depth - self._depth
        self._u, self._depth = u, depth
        if depth > self._loaded[-1][0]:
            self._loaded.append((depth, u))
        for contact, state, pose in zip(self._contacts, self._states, poses, strict=True):
            contact.accept(state, pose)
        return True

    def _state(self) -> State:
        model, indenter = self._model, self._contacts[0]
        force = torch.zeros_like(self._u)
        poses = model._poses(self._request, self._depth)
        history = self._states[0]
        # The accepted state's own forces: friction starts from its history with no further motion.
        indenter.add_force(self._u, poses[0], history, force)
        taxel_force = np.zeros(model.sensor.taxels.count)
        if len(self._contacts) > 1:
            board = self._contacts[1]
            loads = (board.pressure[0] * board.weights).sum(dim=1)
            total = torch.zeros(model.sensor.taxels.count, dtype=torch.float64, device=loads.device)
            taxel_force = total.index_add_(0, model._taxel, loads).cpu().numpy()
        if self._outcome is None:
            raise SolveError("no state was solved", "at least one depth", "give depths")
        u = self._u[0].cpu().numpy().copy()
        return State(u, self._outcome, -force[0].sum(dim=0).cpu().numpy(), taxel_force, model.closure(u))
