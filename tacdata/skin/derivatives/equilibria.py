"""Derivatives of equilibria by parameters, carried along a load path (tangent-linear, implicit differentiation).

At every equilibrium on the path, F(u, h, p) = 0 with the contact's history h and a parameter p. So

    du/dp = -F_u^-1 (F_p + F_h dh/dp),

and accepting the state makes the next dh/dp (Michaleris, Tortorelli and Vidal, Int. J. Numer. Meth. Eng. 37 (1994)
2471). Every parameter is a column of one batch. F_u is the unsymmetric derivative at fixed status of all contact
points; where a point just changes its status, derivatives jump.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch

from tacdata.errors import SolveError
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.contact.history import ContactHistory
from tacdata.skin.derivatives.contact import ConditionsChange, ContactChange, ContactPoint, contact_change
from tacdata.skin.linear.block_gcr import KrylovSpace
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.solve.configuration import Configuration
from tacdata.skin.solve.newton import Newton, Residual

TOLERANCE = 1e-5
"""Error of the linear solves, as `tacdata.skin.linear.block_gcr.GcrSolution` counts it [1]."""

_LAW_STEP = 1e-5
"""Step of the central difference of internal forces by a law's numbers, over these [1]."""

_AUGMENTATIONS, _FOLLOWED = 3, 1e-2
"""How often multipliers follow pressures at most, and the change relative to the largest at which they have [1]."""


Slack = Callable[[torch.Tensor], torch.Tensor]
"""From reactions of held nodes to how they move."""


@dataclass(frozen=True)
class _Point:
    """A state at which derivatives are taken, repeated for every direction."""

    surfaces: tuple[ContactSurface, ...]
    at: Configuration
    now: Residual
    along: tuple[ConditionsChange, ...]
    """Directions, for each contact."""

    def changes(self, du: torch.Tensor, history: tuple[ContactHistory, ...]) -> list[ContactChange]:
        """Return each contact's change along the directions, with ``du`` [mm] and the change of history."""
        return [self._change(k, du, self.along[k], past) for k, past in enumerate(history)]

    def contact_product(self, du: torch.Tensor) -> torch.Tensor:
        """Return the change of contact forces [N] with ``du`` alone."""
        parts = [
            self._change(k, du, along.zeros(), history.zeros(), whole=False).force
            for k, (along, history) in enumerate(zip(self.along, self.at.histories, strict=True))
        ]
        return torch.stack(parts).sum(dim=0)

    def _change(
        self, k: int, du: torch.Tensor, along: ConditionsChange, history: ContactHistory, whole: bool = True
    ) -> ContactChange:
        at = self.at
        point = ContactPoint(at.poses[k], at.histories[k], self.now.contacts[k].pressure)
        return contact_change(self.surfaces[k], at.u, at.conditions, point, du, along, history, whole)


class PathDerivatives:
    """The derivatives on their way along the load path, one column a parameter."""

    def __init__(
        self, newton: Newton, free: torch.Tensor, label: str, tolerance: float = TOLERANCE, slack: Slack | None = None
    ) -> None:
        """Start.

        Args:
            newton: With a preconditioner of its own, for as many members as there are parameters.
            free: 1 for nodes that are not held, else 0, shape (n, 1, 1).
            label: The press in words, for errors.
            tolerance: Error of the linear solves [1].
            slack: How held nodes move with each parameter [mm over its unit], of the reactions [N], shapes (n, 3, p);
                None: not at all.
        """
        self._tolerance, self._slack, self._newton = tolerance, slack, newton
        self._free, self._label = free, label
        self.du = torch.empty(0)
        """Of the displacements [mm over the parameter's unit], shape (n, 3, p)."""
        self.changes: list[ContactChange] = []
        """Of each contact."""
        self.error = 0.0
        """Largest error of the linear solves so far, over what they found [1]."""
        self.products = 0
        """Products with the tangent so far, for benchmarks."""
        self._history: tuple[ContactHistory, ...] = ()
        self._pressure: list[torch.Tensor] = []

    def advance(self, reached: Configuration, along: ConditionsChange) -> None:
        """Take the derivatives on to the next equilibrium; the first call: the touch.

        Args:
            reached: The equilibrium, of one member.
            along: What a unit of each parameter changes there, for the indenter.

        Raises:
            SolveError: If a linear solve does not converge.
        """
        at = reached.repeat(along.pose.place.shape[1])
        at.friction_tangent = torch.ones_like(at.friction_tangent)
        still = replace(along, pose=along.pose.zeros())
        directions = (along, *[still] * (len(self._newton.surfaces) - 1))
        point = _Point(self._newton.surfaces, at, self._newton.residual(at), directions)
        if not self._history:
            self.du = torch.zeros_like(at.u)
            self._history = tuple(history.zeros() for history in at.histories)
        else:
            self._solve(point, self._augmented(reached), self._held(point))
        self.changes = point.changes(self.du, self._history)
        self._pressure = [contact.pressure[..., 0].clone() for contact in point.now.contacts]
        self._history = tuple(
            change.accepted(contact.pressure <= 0, own.pose.place.clone())
            for change, contact, own in zip(self.changes, point.now.contacts, point.along, strict=True)
        )

    def _augmented(self, reached: Configuration) -> bool:
        """Return whether multipliers were augmented at this very state, so that they follow its own pressure."""
        return any(
            bool((history.multiplier[..., 0] != pressure).any())
            for history, pressure in zip(reached.histories, self._pressure, strict=True)
        )

    def _held(self, point: _Point) -> torch.Tensor:
        """Return how held nodes move along each direction [mm over its unit], shape (n, 3, p)."""
        if self._slack is None:
            return torch.zeros_like(point.at.u)
        internal = self._newton.body.internal_force(point.at.u, point.at.conditions)[0]
        external = torch.zeros_like(internal)
        self._newton.add_contact_forces(point.at, external)
        return self._slack((internal - external) * (1 - self._free))

    def _solve(self, point: _Point, augmented: bool, held: torch.Tensor) -> None:
        """Find du; at held nodes it is ``held``."""
        body, free = self._newton.body, self._free
        at = point.at
        contacts = [contact.tangent for contact in point.now.contacts]
        self._newton.preconditioner.update(contacts, at.conditions.modulus)
        internal = self._internal(point)
        known: dict[tuple[int, torch.dtype], tuple[torch.Tensor, Conditions, torch.Tensor | None]] = {}

        def product(p: torch.Tensor) -> torch.Tensor:
            key = p.shape[2], p.dtype
            if key not in known:
                u, own = at.u[:, :, : key[0]].to(key[1]).contiguous(), at.conditions.to(key[1])
                known[key] = u, own, body.dilatation(u, own)
            u, own, dilatation = known[key]
            result = torch.zeros_like(p)
            body.tangent_product(u, p, own, result, dilatation)
            return (result - point.contact_product(p.to(torch.float64))) * free

        space = KrylovSpace(product, self._newton.preconditioner.apply)
        for _ in range(_AUGMENTATIONS if augmented else 1):
            still = point.changes(torch.zeros_like(at.u), self._history)
            rhs = (torch.stack([change.force for change in still]).sum(dim=0) - internal) * free
            if self._slack:
                rhs -= product(held)
            found = space.solve(rhs, self.du * free, self._tolerance)
            self.du, self.products = found.x + held, self.products + found.products
            self.error = max(self.error, float(found.error.max()))
            if not self.error <= self._tolerance:
                raise SolveError(
                    f"{self._label}: derivatives with an error of {self.error:.1e} after {found.products} "
                    "products",
                    f"at most {self._tolerance:g}", "press less deep, or refine the mesh",
                )
            if augmented and self._follow(point.changes(self.du, self._history)):
                break

    def _follow(self, changes: list[ContactChange]) -> bool:
        """Let multipliers change as the pressures do (Uzawa's step); return whether they did so already."""
        moved = [change.pressure - history.multiplier for change, history in zip(changes, self._history, strict=True)]
        for history, change in zip(self._history, changes, strict=True):
            history.multiplier.copy_(change.pressure)
        # Each direction by itself: a pressure over a degree says nothing of one over a millimetre.
        size, move = (_largest(values) for values in ([change.pressure for change in changes], moved))
        return bool((move <= _FOLLOWED * size).all())

    def _internal(self, point: _Point) -> torch.Tensor:
        """Return the change of internal forces [N] with law and thickness at fixed displacements, shape (n, 3, p)."""
        own, along = point.at.conditions, point.along[0].conditions
        share = (along.law / torch.where(own.law != 0, own.law, 1.0)).abs().amax(dim=0)
        share = share.maximum((along.thickness / own.thickness).abs())
        moves = share > 0
        if not bool(moves.any()):
            return torch.zeros_like(point.at.u)
        step = torch.where(moves, _LAW_STEP / share.clamp_min(1e-30), 0.0)
        ends = [
            replace(own, law=own.law + e * along.law, thickness=own.thickness + e * along.thickness)
            for e in (step, -step)
        ]
        upper, lower = (self._newton.body.internal_force(point.at.u, end)[0] for end in ends)
        return torch.where(moves, (upper - lower) / (2 * torch.where(moves, step, 1.0)), 0.0)


def _largest(values: list[torch.Tensor]) -> torch.Tensor:
    """Return the largest magnitude of each direction, shape (p,)."""
    return torch.stack([v.abs().reshape(-1, v.shape[-1]).amax(dim=0) for v in values]).amax(dim=0)
