"""Many presses at once: every column of the batch follows its own load path, and takes the next press when it is done.

No press waits for another: in one Newton iteration some are far from their state, others go on to the next depth.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from tacdata.errors import SolveError
from tacdata.skin.contact.history import ContactHistory
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose
from tacdata.skin.solve.coarse_path import CoarseStart
from tacdata.skin.solve.configuration import Configuration, Unknowns
from tacdata.skin.solve.contact_status import ContactStatus
from tacdata.skin.solve.equilibrium import Equilibria
from tacdata.skin.solve.load_path import LoadPath
from tacdata.skin.solve.newton import Newton, Residual
from tacdata.skin.solve.starts import TOUCHING, Starts

_WILD = 0.3
"""Volume ratio det F below which an extrapolated start is not used [1]."""

_HALVINGS, _SHORTER = 4, 4.0
"""Number and factor of the cuts of a step that diverges; each costs an evaluation for the whole batch."""

_ANY, _STARTED = 1e3, 0.15
"""Residuals that stand in, whole or at the least, for that before the first step of a load step [1]."""

_SLOW = 1.0
"""Share of the residual that a step by friction's tangent may leave at most [1]; else the secant takes over."""

_NEARER = 0.1
"""Share of the residual where the tangent failed from which on it is tried again [1]."""

_AWAY = 1e3
"""Height at which the shapes of an idle column wait [mm]."""


@dataclass(frozen=True)
class PlacedPress:
    """One press as the batch takes it."""

    number: int
    """Number that identifies its states."""
    path: LoadPath
    """Its depths."""
    touch: np.ndarray
    """Place of the indenter's origin at depth 0 [mm], shape (3,)."""
    turn: np.ndarray
    """Rotation from the indenter's frame to the sensor's [1], shape (3, 3)."""
    conditions: Conditions
    """Of one member, on the CPU."""
    coarse: CoarseStart | None = None
    """Its states on a coarser mesh, if they are known: its load steps start from there."""


Collect = Callable[[Equilibria], list[Any]]
"""Converts the states of columns into results."""

Observe = Callable[[list[int], Configuration], None]
"""Receives the numbers of presses that have just reached an equilibrium, requested or not, and their columns, before
the history moves on."""


class Batch:
    """A fixed number of columns on one mesh; each has its own indenter."""

    def __init__(self, newton: Newton, idle: Conditions, nodes: int, capacity: int, floor: float) -> None:
        """Make an idle batch.

        Args:
            newton: Solves; its surfaces are the indenter's and, if the skin has one, the board's.
            idle: Conditions of one idle column.
            nodes: Nodes of the mesh.
            capacity: Number of columns.
            floor: Height of the board [mm].
        """
        self._newton, device = newton, idle.law.device
        u = torch.zeros(nodes, 3, capacity, dtype=torch.float64, device=device)
        eye = torch.eye(3, dtype=torch.float64, device=device)[:, :, None].repeat(1, 1, capacity)
        # Idle columns stay in the batch with an indenter far away: sizes of tensors then need not change.
        heights = (_AWAY, floor)[: len(newton.surfaces)]
        places = (torch.tensor([0.0, 0.0, height], dtype=torch.float64, device=device) for height in heights)
        poses = tuple(Pose(place[:, None].repeat(1, capacity), eye.clone()) for place in places)
        histories = tuple(surface.start(pose) for surface, pose in zip(newton.surfaces, poses, strict=True))
        multipliers = tuple(
            torch.zeros(surface.count, capacity, dtype=torch.float64, device=device) for surface in newton.surfaces
        )
        none = torch.zeros_like(u[0, 0])
        self._at = Configuration(u, multipliers, idle.repeat(capacity), poses, histories, none, none.clone())
        self._base = self._at.unknowns.copy()
        self._status = ContactStatus(newton.surfaces)
        self._starts = Starts(self._base, any(surface.attracts for surface in newton.surfaces))
        self._failed_at = torch.full((capacity,), torch.inf, dtype=torch.float64, device=device)
        self._presses: list[PlacedPress | None] = [None] * capacity
        self._before = torch.full((capacity,), torch.inf, dtype=torch.float64, device=device)
        self.cg = 0
        """Conjugate-gradient iterations so far."""
        self.newton_iterations = 0
        """Newton iterations of the batch so far."""

    def run(
        self, presses: Iterable[PlacedPress], collect: Collect, observe: Observe | None = None
    ) -> Iterator[tuple[int, float, Any]]:
        """Solve presses; yield ``(number, depth, state)`` as found.

        A press that fails yields its `SolveError` in place of a state, and no more.

        Args:
            presses: Presses to solve, taken as columns become free.
            collect: Makes the states that are yielded.
            observe: Receives every equilibrium on the way, from the touch on, if given.

        Raises:
            SolveError: If so many columns do not fit into a GPU's memory.
        """
        try:
            waiting = iter(presses)
            self._fill(waiting, observe)
            while any(press is not None for press in self._presses):
                self._shrink()
                yield from self._iterate(waiting, collect, observe)
        except RuntimeError as error:
            if "out of memory" not in str(error):  # torch and Warp each say it in an error of their own
                raise
            raise SolveError(
                f"{self._at.u.shape[2]} presses at a time on a mesh of {len(self._at.u)} nodes",
                f"as many as the memory of {self._at.u.device} holds",
                "ask for fewer at a time or fewer processes a GPU, or coarsen the mesh",
            ) from error

    def _iterate(
        self, waiting: Iterator[PlacedPress], collect: Collect, observe: Observe | None
    ) -> Iterator[tuple[int, float, Any]]:
        """Do one Newton iteration of every column.

        1. Evaluate the forces; shorten steps that went astray.
        2. Judge every column: found, failed, go on.
        3. Accept converged columns; hand out requested states; send columns on, or give them the next press.
        4. Take failed columns back to their last equilibrium, for a smaller step.
        5. Evaluate changed columns again, and take a Newton step.
        """
        residual = self._settled()
        verdicts = self._judge(residual)
        yield from self._collect(verdicts, residual, collect, observe)
        failed = self._mask(verdicts, "failed")
        yield from self._retreat(verdicts)
        changed = failed | self._mask(verdicts, "found")
        if changed.any():
            self._fill(waiting, observe)
            self._start(changed)
            residual = self._newton.updated(residual, self._at, self._tensor(changed.nonzero()[0]))
        self._step(residual)

    def _settled(self) -> Residual:
        """Evaluate the forces, shortening steps that went astray."""
        residual, at = self._newton.residual(self._at), self._at
        for _ in range(_HALVINGS):
            # After a start there is no step to shorten.
            bad = self._newton.is_bad(self._before, residual) & torch.isfinite(self._before)
            which = bad.nonzero()[:, 0]
            if not len(which):
                break
            base = self._base.take(which)
            at.unknowns.put(which, base.plus(at.unknowns.take(which).minus(base), 1 / _SHORTER))
            residual = self._newton.updated(residual, at, which)
        return residual

    def _judge(self, residual: Residual) -> list[str]:
        changed = self._status.changed(residual.contacts, self._at.conditions.friction).to(residual.relative.dtype)
        # Together, as a GPU is waited for each time that something is read off it.
        columns = [changed, residual.relative, residual.penetration, residual.mean_penetration, residual.volume]
        figures = torch.stack(columns, dim=1).tolist()
        verdicts = ["idle"] * len(figures)
        for column, press in enumerate(self._presses):
            if press is not None:
                if figures[column][0]:
                    press.path.status_changed()
                verdicts[column] = press.path.judge(*figures[column][1:], settings=self._newton.settings)
        found = self._mask(verdicts, "found").nonzero()[0]
        if len(found):
            at, which = self._at, self._tensor(found)
            through = self._newton.surfaces[0].passed_through(
                at.u.index_select(2, which), at.poses[0].take(which), at.conditions.take(which)
            )
            # A smaller step may keep the skin on its side.
            for column in found[through.cpu().numpy()].tolist():
                self._press(column).path.passed_through()
                verdicts[column] = "failed"
        return verdicts

    def _collect(
        self, verdicts: list[str], residual: Residual, collect: Collect, observe: Observe | None
    ) -> Iterator[tuple[int, float, Any]]:
        """Accept the states found and hand out those that are wanted."""
        found = [column for column, verdict in enumerate(verdicts) if verdict == "found"]
        if not found:
            return
        paths = {column: self._press(column).path for column in found}
        # Where the direction turns, the rate of change is of the other branch and predicts nothing.
        reversed_ = [(path.attempt - path.depth) * path.direction < 0 for path in paths.values()]
        steps = self._values({column: path.attempt - path.depth for column, path in paths.items()})
        straight = self._values({column: not back for column, back in zip(found, reversed_, strict=True)}) > 0
        which = self._tensor(self._mask(verdicts, "found"))
        at = self._at
        if observe:
            observe(self._numbers(found), at.take(torch.as_tensor(found, device=at.u.device)))
        for history, contact, pose in zip(at.histories, residual.contacts, at.poses, strict=True):
            history.accept(contact, pose, which)
        # Inactive nodes carry no pressure.
        state = Unknowns(at.u, tuple(contact.pressure for contact in residual.contacts))
        depth = self._values({column: path.attempt for column, path in paths.items()})
        self._starts.accept(which, depth, steps, straight, state)
        requested = [column for column, path in paths.items() if path.found()]
        if requested:
            columns = torch.as_tensor(requested, device=at.u.device)
            relative, penetration = torch.stack([residual.relative, residual.penetration])[:, columns].cpu().numpy()
            changed = [self._press(column).path.changed for column in requested]
            spent = [self._press(column).path.taken() for column in requested]
            states = collect(
                Equilibria(
                    columns,
                    at.u[:, :, columns],
                    at.poses[0].turn[:, :, columns],
                    relative,
                    penetration,
                    spent,
                    changed,
                    residual.contacts,
                )
            )
            for column, state in zip(requested, states, strict=True):
                press = self._press(column)
                yield press.number, press.path.depth, state
        self._release([column for column, path in paths.items() if path.finished])
        for path in paths.values():
            if not path.finished:
                path.go_on()

    def _retreat(self, verdicts: list[str]) -> Iterator[tuple[int, float, SolveError]]:
        """Take failed members back to their last state, for a smaller step."""
        failed = self._mask(verdicts, "failed")
        if not failed.any():
            return
        for column in failed.nonzero()[0].tolist():
            press = self._press(column)
            try:
                press.path.halve()
            except SolveError as error:
                self._release([column])
                yield press.number, press.path.depth, error

    def _fill(self, waiting: Iterator[PlacedPress], observe: Observe | None) -> None:
        """Put waiting presses into idle columns, the indenter just touching."""
        presses: dict[int, PlacedPress] = {}
        for column, press in enumerate(self._presses):
            if press is None and (following := next(waiting, None)) is not None:
                self._presses[column] = presses[column] = following
        if presses:
            at, device = self._at, self._at.u.device
            which = torch.as_tensor(list(presses), device=device)
            joined = Conditions.joined([press.conditions for press in presses.values()]).on(str(device))
            at.conditions.put(which, joined)
            touch, turn = ([getattr(press, name) for press in presses.values()] for name in ("touch", "turn"))
            at.poses[0].place[:, which] = torch.as_tensor(np.stack(touch, axis=-1), device=device).double()
            at.poses[0].turn[:, :, which] = torch.as_tensor(np.stack(turn, axis=-1), device=device).double()
            self._clear(which)
            at.friction_tangent.index_fill_(0, which, 0.0)
            for history, first in zip(at.histories, self._touched(which, observe), strict=True):
                history.put(which, first)
            self._start(np.isin(np.arange(len(self._presses)), list(presses)))

    def _touched(self, which: torch.Tensor, observe: Observe | None) -> tuple[ContactHistory, ...]:
        """Return the histories of columns, by index, whose indenter just touches the undeformed skin."""
        members, surfaces = self._at.take(which), self._newton.surfaces
        members.histories = tuple(surface.start(pose) for surface, pose in zip(surfaces, members.poses, strict=True))
        contacts = self._newton.add_contact_forces(members, torch.zeros_like(members.u))
        if observe:
            observe(self._numbers(which.tolist()), members.copy())
        everyone = torch.ones_like(which, dtype=torch.bool)
        for history, contact, pose in zip(members.histories, contacts, members.poses, strict=True):
            history.accept(contact, pose, everyone)
        return members.histories

    def _start(self, changed: np.ndarray) -> None:
        """Move the changed columns' indenters to the depth to try, and start from a guess of the displacements."""
        busy = {column: press for column, press in enumerate(self._presses) if press is not None and changed[column]}
        which = self._tensor(changed)
        depth = self._values({column: press.path.depth for column, press in busy.items()})
        attempt = self._values({column: press.path.attempt for column, press in busy.items()})
        heights = self._values({c: float(press.touch[2]) - press.path.attempt for c, press in busy.items()})
        busy_mask, place = self._values(dict.fromkeys(busy, 1.0)) > 0, self._at.poses[0].place
        place[2] = torch.where(busy_mask, heights, place[2])
        coarse = {column: press.coarse for column, press in busy.items() if press.coarse}
        guess, near = self._starts.guess(which, depth, attempt, coarse)
        columns = which.nonzero()[:, 0]
        proposed = guess.take(columns)
        # An extrapolated start may fold an element. Then the last equilibrium is a safer start.
        wild = self._newton.body.internal_force(proposed.u, self._at.conditions.take(columns))[1] < _WILD
        proposed = self._starts.accepted.take(columns).where(wild, proposed)
        near[columns] = torch.where(wild, TOUCHING, near[columns])
        self._at.unknowns.put(columns, proposed)
        self._at.near = torch.where(which, near, self._at.near)
        # An infinite residual: the start of a load step has no predecessor to be compared with.
        self._before = torch.where(which, torch.inf, self._before)

    def _step(self, residual: Residual) -> None:
        """Take one Newton step."""
        busy = self._tensor(np.array([press is not None for press in self._presses]))
        if not bool(busy.any()):
            return
        at, first = self._at, torch.isinf(self._before)
        # By the tangent, nodes may flip between opposite slips for ever; by the secant, a majorant, they do not.
        flipping = (at.friction_tangent > 0) & (residual.relative > _SLOW * self._before)
        self._failed_at = torch.where(first, torch.inf, self._failed_at)
        self._failed_at = torch.where(flipping, self._before.minimum(self._failed_at), self._failed_at)
        may = residual.relative < _NEARER * self._failed_at
        at.friction_tangent = torch.where(may, self._newton.friction_tangent(residual), 0.0)
        for press in self._presses:
            if press is not None:
                press.path.stepped()
        self._status.note(residual.contacts, at.conditions.friction)
        advanced, changes, used = self._newton.step(at, residual, busy)
        self.cg, self.newton_iterations = self.cg + used, self.newton_iterations + 1
        # The first step of a load step changes the active set: the residual before it is no reference.
        limit = torch.where(at.near > 0, _ANY, residual.relative)
        self._base, self._before = at.unknowns, torch.where(first, limit.clamp_min(_STARTED), limit)
        at.unknowns = self._base.plus(Unknowns(advanced, changes))
        # Only the first step of a load step adds near nodes to the active set (0019).
        at.near = torch.zeros_like(at.near)

    def _release(self, columns: list[int]) -> None:
        """Make columns idle."""
        if not columns:
            return
        for column in columns:
            self._presses[column] = None
        which = torch.as_tensor(columns, device=self._at.u.device)
        self._at.poses[0].place[2, which] = _AWAY
        self._clear(which)

    def _clear(self, which: torch.Tensor) -> None:
        """Take columns, by index, back to the undeformed skin."""
        self._at.unknowns.flatten(which)
        self._base.flatten(which)
        self._starts.forget(which)
        self._newton.tangent.forget(which)

    def _shrink(self) -> None:
        """Let go of idle columns when no press is waiting; on a GPU, which records sizes, by halving the batch."""
        busy = [column for column, press in enumerate(self._presses) if press is not None]
        idle = [column for column, press in enumerate(self._presses) if press is None]
        width = len(self._presses) if self._at.u.is_cuda else len(busy)
        while 2 * len(busy) <= width:
            width //= 2
        if width == len(self._presses):
            return
        columns = sorted([*busy, *idle[: width - len(busy)]])
        which = torch.tensor(columns, device=self._at.u.device)
        self._at, self._base = self._at.take(which), self._base.take(which)
        self._before, self._failed_at = self._before[which], self._failed_at[which]
        self._starts.keep(which)
        self._status.keep(which)
        self._newton.tangent.keep(which)
        self._presses = [self._presses[column] for column in columns]

    def _press(self, column: int) -> PlacedPress:
        press = self._presses[column]
        if press is None:
            raise IndexError(f"column {column} is idle")
        return press

    def _numbers(self, columns: list[int]) -> list[int]:
        return [self._press(column).number for column in columns]

    def _mask(self, verdicts: list[str], verdict: str) -> np.ndarray:
        return np.array([v == verdict for v in verdicts])

    def _tensor(self, mask: np.ndarray) -> torch.Tensor:
        return torch.as_tensor(mask, device=self._at.u.device)

    def _values(self, by_column: dict[int, float]) -> torch.Tensor:
        values = np.zeros(len(self._presses))
        values[list(by_column)] = [*by_column.values()]
        return self._tensor(values)
