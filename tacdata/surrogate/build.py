"""Builds a table of finite-element presses for the recorded presses, and measures its interpolation error."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tacdata.errors import SolveError
from tacdata.sensor import Sensor
from tacdata.skin.mesh.build import MeshSettings
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.surrogate.grid import Grid, Reach, covering, request
from tacdata.surrogate.press_store import PressStore
from tacdata.surrogate.reading import reading_of
from tacdata.surrogate.solved import Solved
from tacdata.surrogate.table import LoadTable, assembled
from tacdata.transduction import Loads, Transducer

COARSE = MeshSettings(outer=0.8, tip=0.24)
"""A mesh at half the cost of the default one; `tacdata/surrogate/README.md` gives its error."""

FINE, WIDE = 0.8, 1.6
"""Spacings of the positions [mm]; the README gives their errors."""
LEFT_OUT = 3
"""Presses left out of a table, to measure its error."""

LEAST_ERROR = 0.007
"""Least error of a table: root mean square, over the loads' (`benchmarks/settled_studies.md`) [1]."""

Progress = Callable[[int, int, float], None]
"""Called with the presses done, their total, and about how many seconds are left."""


@dataclass(frozen=True)
class TableSettings:
    """Settings of a table."""

    spacing: float | None = None
    """Spacing of the positions [mm]; None: `FINE` where those presses are known already, else `WIDE`."""
    mesh: MeshSettings | None = None
    """The skin's mesh; None: the default one where its presses are known already, else `COARSE`."""
    device: str = "cpu"
    """"cpu", or a GPU such as "cuda:0"."""
    capacity: int = 1
    """Presses solved at the same time: 1 on a CPU, hundreds on a GPU."""
    left_out: int | None = None
    """Further presses solved, to measure its interpolation error. None: 3, or 0 where the table's own presses
    ship.
    """


@dataclass(frozen=True)
class LeftOut:
    """Interpolation error of a table, at presses that are not in it."""

    load: float
    """Root mean square error of the loads over channels and depths, over the largest load of each press [1]."""
    worst: float
    """Largest error of a load, over the largest load of its press [1]."""
    share: float
    """Root mean square error of the loads, over that of the loads [1]."""
    normal: float
    """Root mean square error of the normal force, over its largest [1]."""
    presses: int
    """Number of presses left out."""


@dataclass(frozen=True)
class Work:
    """A table that can be made; its cost is known before it is begun."""

    sensor: Sensor
    settings: TableSettings
    model: SkinModel
    store: PressStore
    grid: Grid
    names: tuple[str, ...]
    """Name of each tool."""
    reaches: tuple[Reach, ...]
    """Positions and depths of each tool."""

    @cached_property
    def requests(self) -> list[tuple[int, tuple[int, int], PressRequest]]:
        """Tool, node and press of everything that is solved."""
        depths, presses = self.grid.depth[: self.grid.states], []
        for t, reach in enumerate(self.reaches):
            for i, j in self.grid.presses(reach):
                press = request(reach, self.grid.x[i], self.grid.y[j], depths, self.sensor)
                if press is not None:
                    presses.append((t, (i, j), press))
        return presses

    @property
    def presses(self) -> int:
        """Presses of the table, and those left out of it."""
        return len(self._all)

    @cached_property
    def probes(self) -> list[tuple[int, PressRequest]]:
        """Tool and press of those left out, at positions between nodes drawn with a fixed seed, not mirrored."""
        rng, presses, count = np.random.default_rng(0), [], self.settings.left_out
        if count is None:
            count = 0 if self._ships else LEFT_OUT
        # Fifty attempts each: where few positions are possible, fewer presses are left out.
        for k in range(50 * count):
            if len(presses) >= count:
                break
            t = k % len(self.reaches)
            reach = self.reaches[t]
            x, y = (float(rng.uniform(a, b)) for a, b in zip(reach.low, reach.high, strict=True))
            # Depths between the table's own, so that the error over depth counts as well.
            depths = np.linspace(0.0, reach.deepest, 4)
            press = request(reach, x, y, depths, self.sensor)
            if press is not None and len(press.depths) == len(depths):
                presses.append((t, press))
        return presses

    @cached_property
    def _ships(self) -> bool:
        return all(self.store.shipped.get(press) is not None for _, _, press in self.requests)

    @property
    def missing(self) -> list[PressRequest]:
        """Presses that are not solved yet."""
        return [self._all[k] for k in self.store.missing(self._all)]

    @property
    def expected_seconds(self) -> float:
        """Expected duration [s]."""
        return self.store.expected_seconds(self._all)

    @property
    def _all(self) -> list[PressRequest]:
        return [press for _, _, press in self.requests] + [press for _, press in self.probes]

    def done(self, progress: Progress = lambda *_: None) -> tuple[LoadTable, LeftOut | None]:
        """Solve missing presses and return the table with its error; after an interruption a second call continues.

        Raises:
            SolveError: If a press that is possible was not solved.
        """
        requests, probes = self.requests, self.probes
        answers = self.store.solve(self._all, self.settings.capacity, progress)
        presses: list[dict[tuple[int, int], Solved]] = [{} for _ in self.reaches]
        for (t, node, _), answer in zip(requests, answers[: len(requests)], strict=True):
            if isinstance(answer, SolveError):
                # A filled node would pass for a solved one, so no possible press may be missing.
                raise answer
            presses[t][node] = answer
        loads = [s.loads for solutions in presses for s in solutions.values()]
        # Of all tools together, as they share one curve.
        all_loads = Loads(*(np.concatenate([getattr(v, n) for v in loads]) for n in ("force", "closure", "area")))
        reading = reading_of(self.sensor, all_loads)
        table = assembled(self.grid, presses, self.names, reading, self.sensor)
        deviation = self._off(table, probes, answers[len(requests) :])
        # A few presses may agree with the table by luck: no error below the least one is claimed.
        return replace(table, error=max(deviation.share if deviation else 0.0, LEAST_ERROR)), deviation

    def _off(
        self, table: LoadTable, probes: list[tuple[int, PressRequest]], answers: Sequence[Solved | SolveError]
    ) -> LeftOut | None:
        response, transducer = table.response, Transducer.of(self.sensor)
        loads, normals, squares = [], [], np.zeros(2)
        for (t, press), answer in zip(probes, answers, strict=True):
            if isinstance(answer, SolveError):
                continue
            depths = np.array(press.depths)
            pose = np.column_stack([np.full(len(depths), press.x), np.full(len(depths), press.y), depths])
            tool = np.full(len(depths), t)
            true = table.reading.load(answer.loads, transducer)
            wrong = response.load(pose, tool) - true
            squares += np.sum(np.square(wrong)), np.sum(np.square(true))
            # Without the first state, whose depth and load are 0.
            loads.append(wrong[1:] / np.abs(true).max())
            normals.append((response.force(pose, tool) - answer.normal)[1:] / answer.normal.max())
        if not loads:
            return None
        wrong, force = np.concatenate(loads), np.concatenate(normals)
        return LeftOut(
            float(np.sqrt(np.mean(wrong**2))),
            float(np.abs(wrong).max()),
            float(np.sqrt(squares[0] / squares[1])),
            float(np.sqrt(np.mean(force**2))),
            len(loads),
        )


def work(sensor: Sensor, reaches: dict[str, Reach], settings: TableSettings | None = None) -> Work:
    """Return the work for a table of these tools; builds the skin model, which takes seconds.

    Args:
        sensor: The sensor.
        reaches: Name of each tool, with its positions and depths.
        settings: How the table is made.

    Raises:
        SolveError: If the sensor cannot be modelled.
    """
    resolved = settings or TableSettings()
    # First with the fine settings: where all those presses exist already, the better table costs nothing.
    estimate = _work(sensor, reaches, resolved, resolved.mesh or MeshSettings(), resolved.spacing or FINE)
    presses = [press for _, _, press in estimate.requests]
    if (resolved.mesh and resolved.spacing) or not estimate.store.missing(presses):
        return estimate
    return _work(sensor, reaches, resolved, resolved.mesh or COARSE, resolved.spacing or WIDE)


def _work(
    sensor: Sensor, reaches: dict[str, Reach], settings: TableSettings, mesh: MeshSettings, spacing: float
) -> Work:
    model = SkinModel(sensor, ModelSettings(mesh=mesh, error_estimate=False), settings.device)
    grid = covering(list(reaches.values()), sensor, spacing)
    return Work(sensor, settings, model, PressStore.of(model), grid, tuple(reaches), tuple(reaches.values()))
