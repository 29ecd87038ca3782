"""Derivatives of equilibria by parameters, carried along a load path (tangent-linear, implicit differentiation).

At every equilibrium on the path forces balance, and the gaps of active nodes are closed: F(x, h, p) = 0. Here x are
displacements and multipliers, h is the contact's history and p a parameter. So

    dx/dp = -F_x^-1 (F_p + F_h dh/dp),

and accepting the state makes the next dh/dp (Michaleris, Tortorelli and Vidal, Int. J. Numer. Meth. Eng. 37 (1994)
2471). Every parameter is a column of one batch. F_x is the unsymmetric derivative at fixed status of all contact nodes;
where a node just changes its status, derivatives jump.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch

from tacdata.errors import SolveError
from tacdata.skin.contact.contact_forces import ContactForces
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.contact.history import ContactHistory
from tacdata.skin.derivatives.contact import ConditionsChange, ContactChange, ContactPoint, contact_change
from tacdata.skin.derivatives.state_preconditioner import StatePreconditioner
from tacdata.skin.linear.block_gcr import KrylovSpace
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.solve.configuration import Configuration
from tacdata.skin.solve.newton import Newton

TOLERANCE = 1e-5
"""Error of the linear solves, as `tacdata.skin.linear.block_gcr.GcrSolution` counts it [1]."""

_LAW_STEP = 1e-5
"""Step of the central difference of internal forces by a law's numbers, over these [1]."""

_WORK = torch.float32
"""Precision of the linear solves' spaces; residuals are in double."""

Slack = Callable[[torch.Tensor], torch.Tensor]
"""From reactions of held nodes to how they move."""


@dataclass(frozen=True)
class _Point:
    """A state at which derivatives are taken, repeated for every direction.

    The unknowns form one field, shape (3n + s, 1, c): displacements, then the normal forces of all contact
    nodes over Young's modulus times 1 mm. Residuals likewise: forces, then mean gaps times Young's modulus times 1 mm.
    So both parts of a field have one unit and nearly one size.
    """

    surfaces: tuple[ContactSurface, ...]
    at: Configuration
    now: tuple[ContactForces, ...]
    """Of each contact."""
    along: tuple[ConditionsChange, ...]
    """Directions, for each contact."""
    modulus: float
    """Young's modulus [MPa]."""

    def changes(
        self,
        du: torch.Tensor,
        pressures: Sequence[torch.Tensor],
        history: tuple[ContactHistory, ...],
        full: bool = True,
    ) -> list[ContactChange]:
        """Return each contact's change along the directions, with displacements, pressures and history.

        Without ``full`` gaps far from contact are left out.
        """
        return [self._change(k, du, pressures[k], self.along[k], past, full) for k, past in enumerate(history)]

    def product(self, du: torch.Tensor, pressures: Sequence[torch.Tensor]) -> list[ContactChange]:
        """Return each contact's change with displacements and pressures alone."""
        return [
            self._change(k, du, pressures[k], change.zeros(), history.zeros(), full=False)
            for k, (change, history) in enumerate(zip(self.along, self.at.histories, strict=True))
        ]

    def joined(self, du: torch.Tensor, pressures: Sequence[torch.Tensor]) -> torch.Tensor:
        """Return displacements [mm] and pressures [MPa] as one field."""
        parts = [p * surface.area[:, None] / self.modulus for surface, p in zip(self.surfaces, pressures, strict=True)]
        return torch.cat([du.reshape(-1, du.shape[2]), *parts])[:, None]

    def parted(self, field: torch.Tensor) -> tuple[torch.Tensor, list[torch.Tensor]]:
        """Return displacements, shape (n, 3, c), and pressures, shape (s, c), both float64; `joined` undone."""
        du, parts = self.halves(field.to(torch.float64))
        forces = parts.split([surface.count for surface in self.surfaces])
        pressures = [
            force * self.modulus / surface.area[:, None] for surface, force in zip(self.surfaces, forces, strict=True)
        ]
        return du.reshape(-1, 3, du.shape[1]), pressures

    def halves(self, field: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the two parts of a field, shapes (3n, c) and (s, c)."""
        size = 3 * len(self.at.u)
        return field[:size, 0].contiguous(), field[size:, 0].contiguous()

    def residual(self, force: torch.Tensor, changes: Sequence[ContactChange]) -> torch.Tensor:
        """Return forces [N] and the changes of active nodes' gaps as one field."""
        gaps = [
            torch.where(forces.tangent.active[:, :1], change.gap, 0.0) * self.modulus
            for forces, change in zip(self.now, changes, strict=True)
        ]
        return torch.cat([force.reshape(-1, force.shape[2]), *gaps])[:, None]

    def _change(
        self,
        k: int,
        du: torch.Tensor,
        pressure: torch.Tensor,
        direction: ConditionsChange,
        history: ContactHistory,
        full: bool = True,
    ) -> ContactChange:
        at = self.at
        point = ContactPoint(at.poses[k], at.histories[k], self.now[k])
        return contact_change(self.surfaces[k], at.u, at.conditions, point, du, pressure, direction, history, full)


class PathDerivatives:
    """The derivatives on their way along the load path, one column a parameter."""

    def __init__(
        self,
        newton: Newton,
        unfixed: torch.Tensor,
        label: str,
        tolerance: float = TOLERANCE,
        slack: Slack | None = None,
        weight: torch.Tensor | None = None,
    ) -> None:
        """Start.

        Args:
            newton: That solved the path, or one like it.
            unfixed: 1 for nodes that are not held, else 0, shape (n, 1, 1).
            label: The press in words, for errors.
            tolerance: Error of the linear solves [1].
            slack: How held nodes move with each parameter [mm over its unit], of the reactions [N], shapes (n, 3, p);
                None: not at all.
            weight: Of each parameter, shape (p,), where errors of all add up (`KrylovSpace.solve`).
        """
        self._tolerance, self._slack, self._newton = tolerance, slack, newton
        self._free, self._label, self._weight = unfixed, label, weight
        self.du = torch.empty(0)
        """Of the displacements [mm over the parameter's unit], shape (n, 3, p)."""
        self.changes: list[ContactChange] = []
        """Of each contact."""
        self.error = 0.0
        """Largest relative error of the linear solves so far [1]."""
        self.products = 0
        """Products with the tangent so far, for benchmarks."""
        self._history: tuple[ContactHistory, ...] = ()
        self._prepared = newton.body.prepared()

    def advance(self, reached: Configuration, along: ConditionsChange) -> None:
        """Take the derivatives on to the next equilibrium; the first call: the touch.

        Args:
            reached: The equilibrium, of one member.
            along: Change of the indenter there by a unit of each parameter.

        Raises:
            SolveError: If a linear solve does not converge.
        """
        newton, count = self._newton, along.pose.place.shape[1]
        # The preconditioner takes friction's stiffness from here: its tangent, which the solver may blend with the
        # secant.
        full_tangent = replace(reached, friction_tangent=torch.ones_like(reached.friction_tangent))
        contacts = newton.residual(full_tangent).contacts
        # The first contact is the indenter's; the board stays where it is.
        still = replace(along, pose=along.pose.zeros())
        directions = (along, *[still] * (len(newton.surfaces) - 1))
        forces = tuple(contact.repeat(count) for contact in contacts)
        modulus = float(full_tangent.conditions.modulus[0])
        point = _Point(newton.surfaces, full_tangent.repeat(count), forces, directions, modulus)
        pressures = [torch.zeros_like(contact.pressure) for contact in forces]
        if not self._history:
            self.du = torch.zeros_like(point.at.u)
            # Before first touch nothing has slipped, so no parameter has changed any history.
            self._history = tuple(history.zeros() for history in point.at.histories)
        else:
            turns = [pose.turn for pose in full_tangent.poses]
            preconditioner = StatePreconditioner(
                newton.preconditioner.rest, newton.surfaces, contacts, full_tangent.conditions.friction, turns
            )
            pressures = self._solve(point, preconditioner, self._held(point))
        self.changes = point.changes(self.du, pressures, self._history)
        self._history = tuple(
            change.accepted(contact.pressure > 0, conditions.pose.place.clone())
            for change, contact, conditions in zip(self.changes, forces, point.along, strict=True)
        )

    def _held(self, point: _Point) -> torch.Tensor:
        """Return how held nodes move along each direction [mm over its unit], shape (n, 3, p)."""
        if self._slack is None:
            return torch.zeros_like(point.at.u)
        internal = self._newton.body.internal_force(point.at.u, point.at.conditions)[0]
        external = torch.zeros_like(internal)
        self._newton.add_contact_forces(point.at, external)
        return self._slack((internal - external) * (1 - self._free))

    def _solve(self, point: _Point, preconditioner: StatePreconditioner, slack: torch.Tensor) -> list[torch.Tensor]:
        """Find du, at held nodes ``slack``, and return the changes of the pressures."""
        body, unfixed, at = self._newton.body, self._free, point.at
        points: dict[tuple[int, torch.dtype], tuple[torch.Tensor, Conditions, torch.Tensor | None]] = {}
        if self._prepared:
            # All columns are directions at one state, so that the stiffness of one member serves them.
            first = torch.zeros(1, dtype=torch.long)
            self._prepared.update_one(at.u[:, :, :1].to(_WORK), at.conditions.take(first).to(_WORK), at.u.shape[2])

        def product(field: torch.Tensor) -> torch.Tensor:
            du, pressures = point.parted(field)
            key = field.shape[2], field.dtype
            internal = torch.zeros(du.shape, dtype=field.dtype, device=du.device)
            if self._prepared and field.dtype == _WORK:
                self._prepared.add_product(du.to(_WORK), torch.arange(key[0]), internal)
            else:
                if key not in points:
                    u, conditions = at.u[:, :, : key[0]].to(key[1]).contiguous(), at.conditions.to(key[1])
                    points[key] = u, conditions, body.dilatation(u, conditions)
                u, conditions, dilatation = points[key]
                body.tangent_product(u, du.to(key[1]), conditions, internal, dilatation)
            changes = point.product(du, pressures)
            return point.residual((internal - _force(changes)) * unfixed, changes)

        def precondition(field: torch.Tensor) -> torch.Tensor:
            force, gaps = point.halves(field)
            z, normal = preconditioner.apply(force, gaps / point.modulus)
            return torch.cat([z, normal / point.modulus])[:, None]

        # The right-hand side: -(F_p + F_h dh/dp), at unchanged displacements and pressures.
        none = [torch.zeros_like(contact.pressure) for contact in point.now]
        still = point.changes(torch.zeros_like(at.u), none, self._history, full=False)
        rhs = -point.residual((self._internal(point) - _force(still)) * unfixed, still)
        # Moves of held nodes are prescribed, hence part of the right-hand side.
        if self._slack:
            rhs -= product(point.joined(slack, none))
        # The derivatives at the previous equilibrium; nodes that have opened since have no pressure left to change.
        guesses = [
            torch.where(forces.tangent.active, change.pressure, 0.0)
            for forces, change in zip(point.now, self.changes, strict=True)
        ]
        guess = point.joined(self.du * unfixed, guesses)
        # All parameters at once: their solutions share most of their directions (decision 0015).
        solution = KrylovSpace(product, precondition).solve(rhs, guess, self._tolerance, weight=self._weight)
        du, pressures = point.parted(solution.x)
        self.du, self.products = du + slack, self.products + solution.products
        self.error = max(self.error, float(solution.error.max()))
        if not self.error <= self._tolerance:
            raise SolveError(
                f"{self._label}: derivatives with an error of {self.error:.1e} after {solution.products} products",
                f"at most {self._tolerance:g}",
                "press less deep, or refine the mesh",
            )
        return pressures

    def _internal(self, point: _Point) -> torch.Tensor:
        """Return the change of internal forces [N] with law and thickness at fixed displacements, shape (n, 3, p)."""
        conditions, directions = point.at.conditions, point.along[0].conditions
        # A number that is 0 has no relative change; its step is measured against 1.
        share = (directions.law / torch.where(conditions.law != 0, conditions.law, 1.0)).abs().amax(dim=0)
        share = share.maximum((directions.thickness / conditions.thickness).abs())
        # Most parameters leave law and thickness alone, and cost no assembly.
        change, moves = torch.zeros_like(point.at.u), (share > 0).nonzero()[:, 0]
        if not len(moves):
            return change
        step, u = _LAW_STEP / share[moves], point.at.u.index_select(2, moves)
        conditions, directions = conditions.take(moves), directions.take(moves)
        ends = [
            replace(
                conditions,
                law=conditions.law + e * directions.law,
                thickness=conditions.thickness + e * directions.thickness,
            )
            for e in (step, -step)
        ]
        # Differences in place of a derivative by each law's numbers: a new law needs no further code.
        upper, lower = (self._newton.body.internal_force(u, end)[0] for end in ends)
        change[:, :, moves] = (upper - lower) / (2 * step)
        return change


def _force(changes: Sequence[ContactChange]) -> torch.Tensor:
    """Return the change of all contacts' forces [N], shape (n, 3, c)."""
    return torch.stack([change.force for change in changes]).sum(dim=0)
