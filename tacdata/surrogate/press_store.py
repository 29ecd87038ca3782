"""Solved presses, stored by a hash of everything that decides them; an interrupted table continues from there."""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from threadpoolctl import threadpool_limits

from tacdata import provenance
from tacdata.errors import SolveError
from tacdata.labels import PathSolution
from tacdata.paths import cache_folder
from tacdata.replacement import replacement as written
from tacdata.skin.model import SkinModel
from tacdata.skin.press import PressRequest
from tacdata.surrogate.shipped import Shipped
from tacdata.surrogate.solved import Solved
from tacdata.transduction import Loads

FIELDS = ("force", "closure", "area", "normal", "seconds", "ended")
TRIES, LEAST = 4, 3
"""A press without an equilibrium is tried this many times, one depth less each time, while at least this many are left.
"""
SECONDS_EACH = 4e-4
"""Solver time per node of the mesh and state on one CPU core [s], used before any was measured."""


@dataclass
class PressStore:
    """Presses of one skin model: those that ship, and those in the user's cache folder."""

    model: SkinModel
    folder: Path
    """The folder; created with the first press."""
    shipped: Shipped
    """Presses of this sensor and mesh that come with tacdata."""

    @classmethod
    def of(cls, model: SkinModel) -> PressStore:
        """Return the store of a model."""
        folder = cache_folder() / "presses" / model.content_hash[:32]
        return cls(model, folder, Shipped.of(model.sensor, model.settings.mesh))

    def path(self, request: PressRequest) -> Path:
        """Return the path of a press: named by a hash of everything that decides it but its end (32 hex digits)."""
        parts = {
            "indenter": request.indenter.document,
            "x": request.x,
            "y": request.y,
            "yaw": request.yaw,
            **{name: tilt for name in ("tilt_x", "tilt_y") if (tilt := getattr(request, name))},
            # Three depths fix the spacing. The end is no part of the name: a deeper press serves shallower requests.
            "depths": list(request.depths[:3]),
            "model": self.model.content_hash,
        }
        return self.folder / f"{provenance.content_hash(parts)[:32]}.npz"

    def get(self, request: PressRequest) -> Solved | None:
        """Return a stored press that goes at least as deep; a damaged file counts as none."""
        if (shipped := self.shipped.get(request)) is not None:
            return shipped
        try:
            with np.load(self.path(request), allow_pickle=False) as data:
                depths = data["depths"]
                force, closure, area, normal, seconds, ended = (data[name] for name in FIELDS)
        # It is solved again, and the file replaced.
        except (OSError, ValueError, KeyError, BadZipFile):
            return None
        solution = Solved(depths, Loads(force, closure, area), normal, float(seconds), bool(ended))
        return solution.down_to(request.depths)

    def put(self, request: PressRequest, solved: Solved) -> None:
        """Store a press."""
        self.folder.mkdir(parents=True, exist_ok=True)
        buffer, values = io.BytesIO(), {name: value for name, value in vars(solved).items() if name != "loads"}
        np.savez_compressed(buffer, **values, **vars(solved.loads))
        with written(self.path(request)) as stream:
            stream.write(buffer.getvalue())

    def missing(self, requests: Sequence[PressRequest]) -> list[int]:
        """Return the presses that are not solved yet."""
        return [k for k, request in enumerate(requests) if self.get(request) is None]

    def expected_seconds(self, requests: Sequence[PressRequest]) -> float:
        """Return the expected time for missing presses [s], from stored ones or from the mesh's size."""
        stored = [self.get(r) for r in requests]
        seconds = [s.seconds / len(s.normal) for s in stored if s is not None and s.seconds > 0]
        # Presses of this mesh and machine tell best what the next one takes.
        each = float(np.median(seconds)) if seconds else SECONDS_EACH * len(self.model.mesh.nodes)
        return each * sum(len(r.depths) for r, s in zip(requests, stored, strict=True) if s is None)

    @threadpool_limits.wrap(limits=1)  # as in tacdata.pipeline.skin_press
    def solve(
        self,
        requests: Sequence[PressRequest],
        capacity: int = 1,
        progress: Callable[[int, int, float], None] = lambda *_: None,
    ) -> list[Solved | SolveError]:
        """Return presses; missing ones are solved now and stored at once.

        Args:
            requests: The presses.
            capacity: Presses solved at the same time (1 on a CPU, hundreds on a GPU).
            progress: Called with the presses done, their total, and about how many seconds are left.
        """
        results: list[Solved | SolveError | None] = [self.get(r) for r in requests]
        begin, stored = time.perf_counter(), sum(f is not None for f in results)
        progress(stored, len(requests), self.expected_seconds(requests))
        missing = {k: requests[k] for k, solved in enumerate(results) if solved is None}
        done, count = 0, len(missing)
        for attempt in range(TRIES):
            numbers, again = list(missing), {}
            for index, answer in self.model.solve_many([missing[k] for k in numbers], capacity):
                k = numbers[index]
                if isinstance(answer, SolveError) and attempt + 1 < TRIES and len(missing[k].depths) > LEAST:
                    again[k] = replace(missing[k], depths=missing[k].depths[:-1])
                    continue
                done += 1
                passed = time.perf_counter() - begin
                if not isinstance(answer, SolveError):
                    answer = self._kept(requests[k], answer, passed / done, attempt > 0)
                results[k] = answer
                progress(stored + done, len(requests), passed / done * (count - done))
            if not (missing := again):
                break
        return [f for f in results if f is not None]

    def _kept(self, request: PressRequest, answer: PathSolution, seconds: float, ended: bool) -> Solved:
        loads = Loads(answer.taxel_force, answer.taxel_closure, answer.taxel_area)
        solved = Solved(answer.depth, loads, answer.force[:, 2], seconds, ended)
        self.put(request, solved)
        return solved
