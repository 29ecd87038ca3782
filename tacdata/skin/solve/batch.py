"""Many presses at once: every column of the batch walks its own load path, and takes the next press when it is done.

No press waits for another: in each Newton iteration one member may be far from its state while another has just found
its own and is sent on to the next depth.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from tacdata.errors import SolveError
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose
from tacdata.skin.solve.load_path import Walk
from tacdata.skin.solve.loading_states import PassedStates
from tacdata.skin.solve.newton import Balance, Newton

_WILD = 0.3
"""Volume ratio det F below which an extrapolated start is not used [1]."""

_HALVINGS, _SHORTER = 4, 4.0
"""How often a step that went astray is shortened, and by what; each costs an evaluation for the whole batch."""

_AWAY = 1e3
"""Height at which the shapes of an idle column wait [mm]."""


@dataclass(frozen=True)
class Press:
    """One press as the batch sees it."""

    number: int
    """By which its states are told apart."""
    walk: Walk
    """Its depths."""
    touch: np.ndarray
    """Place of the indenter's origin at depth 0 [mm], shape (3,)."""
    turn: np.ndarray
    """Rotation from the indenter's frame to the sensor's [1], shape (3, 3)."""
    conditions: Conditions
    """Of one member."""


@dataclass(frozen=True)
class Members:
    """Columns of the batch that have just found their state."""

    column: torch.Tensor
    """Their indices, shape (k,)."""
    u: torch.Tensor
    """Displacements [mm], shape (n, 3, k)."""
    error: np.ndarray
    """Out-of-balance force over the contact force [1], shape (k,)."""
    penetration: np.ndarray
    """Largest penetration [mm], shape (k,)."""
    spent: list[int]
    """Newton iterations since the state before."""


Collect = Callable[[Members], list[Any]]
"""Makes of every member's state what is to be kept of it."""


class Batch:
    """A fixed number of columns on one mesh, one shape of indenter."""

    def __init__(self, newton: Newton, idle: Conditions, nodes: int, capacity: int, floor: float) -> None:
        """Make an idle batch.

        Args:
            newton: Solves; its contacts are the indenter's and, if the skin stands on one, the board's.
            idle: Conditions of one idle column.
            nodes: Nodes of the mesh.
            capacity: Number of columns.
            floor: Height of the board [mm].
        """
        self._newton, device = newton, idle.law.device
        self._conditions = idle.repeat(capacity)
        self._u = torch.zeros(nodes, 3, capacity, dtype=torch.float64, device=device)
        self._base, self._accepted = torch.zeros_like(self._u), torch.zeros_like(self._u)
        self._rate = torch.zeros_like(self._u)
        self._passed = PassedStates((nodes, 3, capacity), str(device))
        eye = torch.eye(3, dtype=torch.float64, device=device)[:, :, None].repeat(1, 1, capacity)
        heights = (_AWAY, floor)[: len(newton.contacts)]
        self._poses = [Pose(self._row([0.0, 0.0, height]).repeat(1, capacity), eye.clone()) for height in heights]
        self._states = [contact.start(pose) for contact, pose in zip(newton.contacts, self._poses, strict=True)]
        self._multipliers = [state.multiplier.clone() for state in self._states]
        self._presses: list[Press | None] = [None] * capacity
        self._before = torch.full((capacity,), torch.inf, dtype=torch.float64, device=device)
        self.cg = 0
        """Conjugate-gradient iterations so far."""
        self.ticks = 0
        """Newton iterations of the batch so far."""

    def run(self, presses: Iterable[Press], collect: Collect) -> Iterator[tuple[int, float, Any]]:
        """Walk through presses; yield ``(number, depth, state)`` as found, the state as `collect` makes it.

        A press that fails yields its `SolveError` in place of a state, and no more.

        Raises:
            SolveError: If so many columns do not fit into a card's memory.
        """
        try:
            yield from self._run(presses, collect)
        except torch.OutOfMemoryError as error:
            nodes, _, count = self._u.shape
            raise SolveError(
                f"{count} presses at a time on a mesh of {nodes} nodes",
                f"as many as the memory of {self._u.device} holds",
                "ask for fewer at a time, or coarsen the mesh",
            ) from error

    def _run(self, presses: Iterable[Press], collect: Collect) -> Iterator[tuple[int, float, Any]]:
        waiting = iter(presses)
        yield from self._fill(waiting)
        while any(press is not None for press in self._presses):
            now = self._settled()
            verdicts = self._judge(now)
            yield from self._collect(verdicts, now, collect)
            failed = self._mask(verdicts, "failed")
            yield from self._retreat(verdicts)
            changed, augment = failed | self._mask(verdicts, "found"), self._mask(verdicts, "augment")
            if changed.any():
                yield from self._fill(waiting)
                self._start(changed)
            if augment.any():
                which = self._tensor(augment)
                for contact, state in zip(self._newton.contacts, self._states, strict=True):
                    contact.augment(state, which)
            if (changed | augment).any():
                now = self._rebalance(now, changed | augment)
            self._step(now)

    def _settled(self) -> Balance:
        """Evaluate the forces, shortening steps that went astray."""
        now = self._balance()
        step = self._u - self._base
        for _ in range(_HALVINGS):
            # After a start there is no step to shorten.
            bad = self._newton.is_bad(self._before, now) & torch.isfinite(self._before)
            marks = bad.cpu().numpy()
            if not marks.any():
                break
            step = torch.where(bad, step / _SHORTER, step)
            self._u = torch.where(bad, self._base + step, self._u)
            now = self._rebalance(now, marks)
        return now

    def _balance(self) -> Balance:
        return self._newton.balance(self._u, self._poses, self._states, self._conditions)

    def _rebalance(self, now: Balance, changed: np.ndarray) -> Balance:
        which = torch.as_tensor(changed.nonzero()[0], device=self._u.device)
        return self._newton.rebalance(now, self._u, self._poses, self._states, self._conditions, which)

    def _judge(self, now: Balance) -> list[str]:
        figures = torch.stack([now.error, now.penetration, now.mean_penetration, now.volume]).cpu().numpy()
        self._figures = figures
        settings = self._newton.settings
        rows = figures.T.tolist()
        return [
            "idle" if press is None else press.walk.judge(error, penetration, mean, volume, settings)
            for press, (error, penetration, mean, volume) in zip(self._presses, rows, strict=True)
        ]

    def _collect(self, verdicts: list[str], now: Balance, collect: Collect) -> Iterator[tuple[int, float, Any]]:
        """Accept the states found and hand out those that are wanted."""
        found = [column for column, verdict in enumerate(verdicts) if verdict == "found"]
        if not found:
            return
        walks = {column: self._press(column).walk for column in found}
        turned = [(walk.attempt - walk.depth) * walk.direction < 0 for walk in walks.values()]
        moved = self._values({column: walk.attempt - walk.depth for column, walk in walks.items()})
        straight = self._values({column: not back for column, back in zip(found, turned, strict=True)}) > 0
        which = self._tensor(self._mask(verdicts, "found"))
        for contact, state, pose in zip(self._newton.contacts, self._states, self._poses, strict=True):
            contact.accept(state, pose, which)
        for kept, state in zip(self._multipliers, self._states, strict=True):
            kept.copy_(torch.where(which, state.multiplier, kept))
        rate = torch.where(straight & (moved != 0), (self._u - self._accepted) / moved, 0.0)
        self._rate = torch.where(which & ((moved != 0) | ~straight), rate, self._rate)
        self._accepted = torch.where(which, self._u, self._accepted)
        depth = self._values({column: walk.attempt for column, walk in walks.items()})
        self._passed.add(which, depth, self._u)
        wanted = [column for column, walk in walks.items() if walk.found()]
        if wanted:
            columns = torch.as_tensor(wanted, device=self._u.device)
            error, penetration = self._figures[0, wanted], self._figures[1, wanted]
            spent = [self._press(column).walk.spent for column in wanted]
            states = collect(Members(columns, self._u[:, :, columns], error, penetration, spent))
            for column, state in zip(wanted, states, strict=True):
                press = self._press(column)
                press.walk.spent = 0
                yield press.number, press.walk.depth, state
        self._release([column for column, walk in walks.items() if walk.finished])
        for walk in walks.values():
            if not walk.finished:
                walk.go_on()

    def _retreat(self, verdicts: list[str]) -> Iterator[tuple[int, float, SolveError]]:
        """Take failed members back to their last state, for a smaller step."""
        failed = self._mask(verdicts, "failed")
        if not failed.any():
            return
        which = self._tensor(failed)
        for kept, state in zip(self._multipliers, self._states, strict=True):
            state.multiplier.copy_(torch.where(which, kept, state.multiplier))
        for column in failed.nonzero()[0].tolist():
            press = self._press(column)
            try:
                press.walk.halve()
            except SolveError as error:
                self._release([column])
                yield press.number, press.walk.depth, error

    def _fill(self, waiting: Iterator[Press]) -> Iterator[tuple[int, float, SolveError]]:
        """Put waiting presses into idle columns, the indenter just touching."""
        taken: dict[int, Press] = {}
        for column, press in enumerate(self._presses):
            if press is None and (one := next(waiting, None)) is not None:
                self._presses[column] = taken[column] = one
        if taken:
            new, device = np.isin(np.arange(len(self._presses)), list(taken)), self._u.device
            which = torch.as_tensor(list(taken), device=device)
            self._conditions.put_all(which, [press.conditions for press in taken.values()])
            touch, turn = ([getattr(press, name) for press in taken.values()] for name in ("touch", "turn"))
            self._poses[0].place[:, which] = torch.as_tensor(np.stack(touch, axis=-1), device=device).double()
            self._poses[0].turn[:, :, which] = torch.as_tensor(np.stack(turn, axis=-1), device=device).double()
            for field in (self._u, self._base, self._accepted, self._rate):
                field.index_fill_(-1, which, 0.0)
            self._passed.forget(self._tensor(new))
            own, flat = self._conditions.take(which), self._u[:, :, which]
            for contact, state, pose, kept in zip(
                self._newton.contacts, self._states, self._poses, self._multipliers, strict=True
            ):
                contact.sharp = contact.sharp.index_fill(0, which, 0.0)
                here = pose.take(which)
                twin = contact.twin(here, which)
                first = twin.start(here)
                twin.add_force(flat, here, first, own, torch.zeros_like(flat))
                twin.accept(first, here, torch.ones_like(which, dtype=torch.bool))
                state.set(which, first)
                kept.index_fill_(-1, which, 0.0)
            self._start(new)
        yield from ()

    def _start(self, changed: np.ndarray) -> None:
        """Move the changed columns' indenters to the depth to try, and start from a guess of the displacements."""
        busy = {column: press for column, press in enumerate(self._presses) if press is not None and changed[column]}
        which = self._tensor(changed)
        depth = self._values({column: press.walk.depth for column, press in busy.items()})
        attempt = self._values({column: press.walk.attempt for column, press in busy.items()})
        heights = self._values({c: float(press.touch[2]) - press.walk.attempt for c, press in busy.items()})
        moved, place = self._values(dict.fromkeys(busy, 1.0)) > 0, self._poses[0].place
        place[2] = torch.where(moved, heights, place[2])
        guess = self._accepted + self._rate * (attempt - depth)
        beyond = attempt >= self._passed.deepest
        if not bool((beyond | ~which).all()):
            back = self._passed.at(attempt) + (self._accepted - self._passed.at(depth))
            guess = torch.where(beyond, guess, back)
        columns = which.nonzero()[:, 0]
        chosen = guess.index_select(-1, columns)
        volume = self._newton.body.internal_force(chosen, self._conditions.take(columns))[1]
        chosen = torch.where(volume < _WILD, self._accepted.index_select(-1, columns), chosen)
        self._u = self._u.index_copy(-1, columns, chosen)
        self._before = torch.where(which, torch.inf, self._before)

    def _step(self, now: Balance) -> None:
        """Take one Newton step."""
        busy = self._tensor(np.array([press is not None for press in self._presses]))
        if not bool(busy.any()):
            return
        self._newton.sharpen(now.error)
        step, used = self._newton.step(self._u, now.residual, self._conditions, busy)
        self.cg, self.ticks = self.cg + used, self.ticks + 1
        self._base, self._before = self._u, now.size
        self._u = self._u + step

    def _release(self, columns: list[int]) -> None:
        """Make columns idle."""
        if not columns:
            return
        for column in columns:
            self._presses[column] = None
        which = torch.as_tensor(columns, device=self._u.device)
        self._poses[0].place[2, which] = _AWAY
        for state, kept in zip(self._states, self._multipliers, strict=True):
            state.multiplier.index_fill_(-1, which, 0.0)
            kept.index_fill_(-1, which, 0.0)
        for field in (self._u, self._base, self._accepted, self._rate):
            field.index_fill_(-1, which, 0.0)

    def _press(self, column: int) -> Press:
        press = self._presses[column]
        if press is None:
            raise IndexError(f"column {column} is idle")
        return press

    def _mask(self, verdicts: list[str], verdict: str) -> np.ndarray:
        return np.array([v == verdict for v in verdicts])

    def _tensor(self, mask: np.ndarray) -> torch.Tensor:
        return torch.as_tensor(mask, device=self._u.device)

    def _values(self, by_column: dict[int, float]) -> torch.Tensor:
        values = np.zeros(len(self._presses))
        values[list(by_column)] = list(by_column.values())
        return torch.as_tensor(values, device=self._u.device)

    def _row(self, values: Any) -> torch.Tensor:
        return torch.as_tensor(np.asarray(values, dtype=float), device=self._u.device)[:, None]

