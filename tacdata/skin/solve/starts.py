"""Where load steps start from: a coarser mesh's states, the states before, or those of the way down."""

from __future__ import annotations

from collections.abc import Mapping

import torch

from tacdata.skin.solve.coarse_path import CoarseStart, changes
from tacdata.skin.solve.configuration import Unknowns
from tacdata.skin.solve.loading_states import LoadingStates

TOUCHING = 0.02
"""Gap up to which nodes are active when a load step begins without a word on active nodes [mm]: the tips on the board
bear load from the first."""


class Starts:
    """The last equilibrium of every member of a batch, and an estimate of its next one."""

    def __init__(self, sample: Unknowns, sticky: bool) -> None:
        """Begin flat.

        Args:
            sample: Unknowns of as many members.
            sticky: Whether the skin sticks: a jump is foretold by nothing.
        """
        self.accepted, self._rate = sample.zeros(), sample.zeros()
        self._loading, self._sticky = LoadingStates(sample), sticky

    def forget(self, which: torch.Tensor) -> None:
        """Take members, by index, shape (k,), back to the undeformed skin."""
        self._loading.forget(which)
        for state in (self.accepted, self._rate):
            state.flatten(which)

    def keep(self, which: torch.Tensor) -> None:
        """Let go of all members but some, by index, shape (k,)."""
        self.accepted, self._rate = self.accepted.take(which), self._rate.take(which)
        self._loading.keep(which)

    def accept(
        self, which: torch.Tensor, depth: torch.Tensor, step: torch.Tensor, straight: torch.Tensor, state: Unknowns
    ) -> None:
        """Take the marked members' unknowns as their equilibrium.

        Args:
            which: Members, shape (b,), bool.
            depth: Of the equilibrium [mm], shape (b,).
            step: Step that led to it [mm], likewise.
            straight: Whether the step before went the same way, likewise.
            state: Unknowns of all members.
        """
        inverse = torch.where(straight & (step != 0), 1 / torch.where(step != 0, step, 1.0), 0.0)
        # Of the members that are meant alone: few are, and fields are large.
        rated, found = (mask.nonzero()[:, 0] for mask in (which & ((step != 0) | ~straight), which))
        change = state.take(rated).minus(self.accepted.take(rated))
        self._rate.put(rated, change.zeros().plus(change, inverse[rated]))
        self.accepted.put(found, state.take(found))
        self._loading.add(which, depth, state)

    def guess(
        self, which: torch.Tensor, depth: torch.Tensor, attempt: torch.Tensor, coarse: Mapping[int, CoarseStart]
    ) -> tuple[Unknowns, torch.Tensor]:
        """Return a start for the marked members, and the gap up to which nodes are active in it [mm], shape (b,).

        A step down changes as on a coarser mesh, where that is known, else as the step before. A step up starts from
        the state of its depth on the way down. These say which nodes are active; an extrapolation does not.

        Args:
            which: Members, shape (b,), bool.
            depth: Of the last equilibrium [mm], shape (b,).
            attempt: Where to start [mm], shape (b,).
            coarse: Of members by their columns, where there is one.
        """
        guess, near = self.accepted.plus(self._rate, attempt - depth), torch.full_like(depth, TOUCHING)
        beyond = attempt >= self._loading.deepest
        # On the way up, states of the way down at the same depth are nearer than any extrapolation.
        if not bool((beyond | ~which).all()):
            back = self._loading.back(self.accepted, depth, attempt, leaves=not self._sticky)
            guess, near = guess.where(beyond, back), torch.where(beyond | self._sticky, near, 0.0)
        if self._sticky:
            return guess, near
        down = (beyond & which & (attempt > depth)).nonzero()[:, 0].tolist()
        columns = [column for column in down if column in coarse]
        if columns:
            steps = torch.stack([depth, attempt])[:, columns].T.tolist()
            available, change = changes([(coarse[c], *step) for c, step in zip(columns, steps, strict=True)])
            if change is not None:
                place = torch.as_tensor([columns[k] for k in available], device=depth.device)
                guess.put(place, self.accepted.take(place).plus(change))
                near[place] = 0.0
        return guess, near
