"""Derivatives of equilibria by parameters, carried along a load path (tangent-linear, implicit differentiation).

At every equilibrium on the path, F(u, h, p) = 0 with the contact's history h and a parameter p. So

    du/dp = -F_u^-1 (F_p + F_h dh/dp),

and accepting the state makes the next dh/dp (Michaleris, Tortorelli and Vidal, Int. J. Numer. Meth. Eng. 37 (1994)
2471). Every parameter is a column of one batch. F_u is the unsymmetric derivative at fixed status of all contact
points; where a point just changes its status, derivatives jump.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import torch
import warp as wp

from tacdata.errors import SolveError
from tacdata.skin.contact.contact import Contact, ContactState
from tacdata.skin.derivatives.contact import ConditionsChange, ContactChange, contact_change
from tacdata.skin.derivatives.trail import Milestone
from tacdata.skin.linear.block_gcr import Space
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose
from tacdata.skin.solve.newton import Newton

TOLERANCE = 1e-5
"""Error of the linear solves, as `tacdata.skin.linear.block_gcr.Solution` counts it [1]."""

_LAW_STEP = 1e-5
"""Step of the central difference of internal forces by a law's numbers, over these [1]."""

_AUGMENTATIONS, _FOLLOWED = 3, 1e-2
"""How often multipliers follow pressures at most, and the change relative to the largest at which they have [1]."""


Slack = Callable[[torch.Tensor], torch.Tensor]
"""From reactions of held nodes to how they move."""


@dataclass(frozen=True)
class _Point:
    """A state at which derivatives are taken, repeated for every direction."""

    contacts: list[Contact]
    distances: list[wp.Function]
    u: torch.Tensor
    poses: list[Pose]
    states: list[ContactState]
    conditions: Conditions
    along: list[ConditionsChange]
    """Directions, for each contact."""

    def changes(self, du: torch.Tensor, history: list[ContactState]) -> list[ContactChange]:
        """Return each contact's change along the directions, with ``du`` [mm] and the change of history."""
        return [self._change(k, du, self.along[k], past) for k, past in enumerate(history)]

    def contact_product(self, du: torch.Tensor) -> torch.Tensor:
        """Return the change of contact forces [N] with ``du`` alone."""
        parts = [
            self._change(k, du, along.still(), _zeros(state), whole=False).force
            for k, (along, state) in enumerate(zip(self.along, self.states, strict=True))
        ]
        return torch.stack(parts).sum(dim=0)

    def _change(
        self, k: int, du: torch.Tensor, along: ConditionsChange, history: ContactState, whole: bool = True
    ) -> ContactChange:
        return contact_change(
            self.contacts[k], self.distances[k], self.u, self.poses[k], self.states[k], self.conditions, du, along,
            history, whole,
        )


class Tangents:
    """The derivatives on their way along the load path, one column a parameter."""

    def __init__(
        self, newton: Newton, distances: list[wp.Function], free: torch.Tensor, label: str,
        tolerance: float = TOLERANCE, slack: Slack | None = None,
    ) -> None:
        """Start.

        Args:
            newton: For as many members as there are parameters, not that of the press itself.
            distances: Of the contacts' shapes.
            free: 1 for nodes that are not held, else 0, shape (n, 1, 1).
            label: The press in words, for errors.
            tolerance: Error of the linear solves [1].
            slack: How held nodes move with each parameter [mm over its unit], of the reactions [N], shapes (n, 3, p);
                None: not at all.
        """
        self._tolerance, self._slack = tolerance, slack
        self._newton, self._contacts, self._distances = newton, newton.contacts, distances
        self._free, self._label = free, label
        self.du = torch.empty(0)
        """Of the displacements [mm over the parameter's unit], shape (n, 3, p)."""
        self.changes: list[ContactChange] = []
        """Of each contact."""
        self.error = 0.0
        """Largest error of the linear solves so far, over what they found [1]."""
        self.products = 0
        """Products with the tangent so far, for benchmarks."""
        self._history: list[ContactState] = []
        self._pressure: list[torch.Tensor] = []

    def advance(self, milestone: Milestone, along: ConditionsChange) -> None:
        """Take the derivatives on to the next equilibrium; the first call: the touch.

        Args:
            milestone: The equilibrium.
            along: What a unit of each parameter changes there, for the indenter.

        Raises:
            SolveError: If a linear solve does not converge.
        """
        count = along.pose.place.shape[1]
        point = _Point(
            self._contacts, self._distances, milestone.u.repeat(1, 1, count).contiguous(),
            [_repeat(pose, count) for pose in milestone.poses], [_repeat(state, count) for state in milestone.states],
            milestone.conditions.repeat(count),
            [along] + [replace(along, pose=along.still().pose)] * (len(self._contacts) - 1),
        )
        touch = not self._history
        if touch:
            self.du = torch.zeros_like(point.u)
            self._history = [_zeros(state) for state in point.states]
        for contact in self._contacts:
            contact.sharp = torch.ones_like(contact.sharp)
        self._newton.balance(point.u, point.poses, point.states, point.conditions)
        if not touch:
            self._solve(point, self._augmented(milestone), self._held(point))
        self.changes = point.changes(self.du, self._history)
        self._pressure = [contact.pressure[..., 0].clone() for contact in self._contacts]
        self._history = [
            change.accepted(contact.pressure <= 0, own.pose.place.clone())
            for change, contact, own in zip(self.changes, self._contacts, point.along, strict=True)
        ]

    def _augmented(self, milestone: Milestone) -> bool:
        """Return whether multipliers were augmented at this very state, so that they follow its own pressure."""
        return any(
            bool((state.multiplier[..., 0] != pressure).any())
            for state, pressure in zip(milestone.states, self._pressure, strict=True)
        )

    def _held(self, point: _Point) -> torch.Tensor:
        """Return how held nodes move along each direction [mm over its unit], shape (n, 3, p)."""
        if self._slack is None:
            return torch.zeros_like(point.u)
        internal = self._newton.body.internal_force(point.u, point.conditions)[0]
        external = torch.zeros_like(internal)
        for contact, pose, state in zip(self._contacts, point.poses, point.states, strict=True):
            contact.add_force(point.u, pose, state, point.conditions, external)
        return self._slack((internal - external) * (1 - self._free))

    def _solve(self, point: _Point, augmented: bool, held: torch.Tensor) -> None:
        """Find du; at held nodes it is ``held``."""
        body, free = self._newton.body, self._free
        self._newton.preconditioner.update(point.conditions.modulus)
        internal = self._internal(point)

        fields: dict[tuple[int, torch.dtype], torch.Tensor] = {}

        def product(p: torch.Tensor) -> torch.Tensor:
            key = p.shape[2], p.dtype
            if key not in fields:
                fields[key] = point.u[:, :, : key[0]].to(key[1]).contiguous()
            result = torch.zeros_like(p)
            body.tangent_product(fields[key], p, point.conditions, result)
            return (result - point.contact_product(p.to(torch.float64))) * free

        space = Space(product, self._newton.preconditioner.apply)
        for _ in range(_AUGMENTATIONS if augmented else 1):
            still = point.changes(torch.zeros_like(point.u), self._history)
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
        own, along = point.conditions, point.along[0].conditions
        share = (along.law / torch.where(own.law != 0, own.law, 1.0)).abs().amax(dim=0)
        share = share.maximum((along.thickness / own.thickness).abs())
        moves = share > 0
        if not bool(moves.any()):
            return torch.zeros_like(point.u)
        step = torch.where(moves, _LAW_STEP / share.clamp_min(1e-30), 0.0)
        ends = [
            replace(own, law=own.law + e * along.law, thickness=own.thickness + e * along.thickness, _other={})
            for e in (step, -step)
        ]
        upper, lower = (self._newton.body.internal_force(point.u, end)[0] for end in ends)
        return torch.where(moves, (upper - lower) / (2 * torch.where(moves, step, 1.0)), 0.0)


def _repeat[T: (Pose, ContactState)](one: T, count: int) -> T:
    """Return equal members made of a single one."""
    values = (getattr(one, field.name) for field in fields(one))
    return type(one)(*(value.repeat(*[1] * (value.dim() - 1), count) for value in values))


def _largest(values: list[torch.Tensor]) -> torch.Tensor:
    """Return the largest magnitude of each direction, shape (p,)."""
    return torch.stack([v.abs().reshape(-1, v.shape[-1]).amax(dim=0) for v in values]).amax(dim=0)


def _zeros(state: ContactState) -> ContactState:
    """Return the history that does not change."""
    return ContactState(*(torch.zeros_like(getattr(state, field.name)) for field in fields(state)))
