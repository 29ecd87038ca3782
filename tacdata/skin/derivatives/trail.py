"""Every equilibrium that a press passes, wanted or not, with the history that it started from."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from tacdata.skin.contact.contact import Contact, ContactState
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose


@dataclass(frozen=True)
class Milestone:
    """One accepted state of one member; the first of a press is the touch, without load."""

    u: torch.Tensor
    """Displacements [mm], shape (n, 3, 1)."""
    conditions: Conditions
    """Of the member."""
    poses: tuple[Pose, ...]
    """Of each contact's shape."""
    states: tuple[ContactState, ...]
    """History of each contact that the state was found with, multipliers as augmented last."""


class Trail:
    """Milestones of a batch of one column, noted when its contacts accept them."""

    def __init__(self, contacts: list[Contact]) -> None:
        """Watch the contacts of a batch of one column."""
        self._milestones: list[Milestone] = []
        self._poses: list[Pose] = []
        self._states: list[ContactState] = []
        for contact in contacts:
            self._watch(contact, last=contact is contacts[-1])

    def _watch(self, contact: Contact, last: bool) -> None:
        evaluate, accept = contact.add_force, contact.accept
        seen: list[tuple[torch.Tensor, Conditions]] = []

        def add_force(
            u: torch.Tensor, pose: Pose, state: ContactState, conditions: Conditions, force: torch.Tensor
        ) -> None:
            seen[:] = [(u, conditions)]
            evaluate(u, pose, state, conditions, force)

        def noted(state: ContactState, pose: Pose, which: torch.Tensor) -> None:
            self._poses.append(pose.copy())
            self._states.append(state.copy())
            if last:
                [(u, conditions)] = seen
                own = conditions.take(torch.zeros(1, dtype=torch.int64, device=u.device))
                self._milestones.append(Milestone(u.clone(), own, tuple(self._poses), tuple(self._states)))
                self._poses.clear()
                self._states.clear()
            accept(state, pose, which)

        contact.add_force, contact.accept = add_force, noted

    def take(self) -> list[Milestone]:
        """Return the milestones since the last call."""
        taken = list(self._milestones)
        self._milestones.clear()
        return taken
