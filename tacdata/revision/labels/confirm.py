"""Solves presses with finite elements where a revised model changes the loads most, and compares with the table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tacdata.chain import predict
from tacdata.chain.table_response import TableResponse
from tacdata.effects import Placed
from tacdata.errors import SolveError
from tacdata.revision.comparison import Comparison
from tacdata.revision.labels.relabel import changed_skin
from tacdata.sensor import Sensor
from tacdata.skin.mesh.build import MeshSettings
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.surrogate.grid import Reach
from tacdata.surrogate.press_store import PressStore
from tacdata.surrogate.reading import reading_of
from tacdata.transduction import Loads, Transducer

SHALLOW = 0.03
"""Least depth of a press that is solved again, and of its first state [mm]."""


@dataclass(frozen=True)
class Confirmed:
    """One press, solved again."""

    tool: str
    place: tuple[float, float]
    """x and y [mm]."""
    depth: float
    """Depth of the tip by the revised model [mm]."""
    change: float
    """Largest change of a load by the revision, over the largest load [1]."""
    difference: float
    """Root mean square difference of surrogate and finite elements over the channels, over the largest load [1]."""
    most: float
    """Largest difference over the channels, over the largest load [1]."""
    solved: bool
    """Whether an equilibrium was found; without one the figures are NaN."""


def touches_fem(placed: Sequence[Placed]) -> bool:
    """Return whether effects change the input of the finite elements: the tip's position, or the skin's thickness."""
    return any(p.stage == "kinematics" or p.effect.changes_skin for p in placed)


def confirm(
    comparison: Comparison,
    placed: Sequence[Placed],
    sensor: Sensor,
    reaches: dict[str, Reach],
    count: int,
    mesh: MeshSettings,
    progress: Callable[[int, int, float], None] = lambda *_: None,
) -> list[Confirmed]:
    """Solve a few presses where the effects change the loads most, each at another place.

    Args:
        comparison: Recordings and a model that starts from a table.
        placed: The effects that were added.
        sensor: The sensor.
        reaches: The tools by name.
        count: Number of presses.
        mesh: The mesh that the table was made on.
        progress: Called with the presses done, their total, and the seconds left.
    """
    response = comparison.setting.response
    if not isinstance(response, TableResponse) or not touches_fem(placed) or count < 1:
        return []
    course = comparison.course
    nominal = predict(course, response, comparison.setting.given).pose
    revised = predict(course, response, [*comparison.setting.given, *placed]).pose
    mechanical = [p for p in placed if p.effect.changes_skin]
    # Two changes of the loads: the tip is elsewhere, and effects of the skin multiply them.
    loads, revised_loads = response.load(nominal, course.tool), response.load(revised, course.tool)
    for effect in mechanical:
        revised_loads = revised_loads * _factor(comparison, effect, revised)[:, None]
    # Both the change and the difference are given over the largest load, so that they can be compared.
    top = max(float(np.abs(loads).max()), 1e-12)
    change = np.abs(revised_loads - loads).max(axis=1) / top
    rows = _spread(change, course.row_site, course.tool, count)
    skin = changed_skin(sensor, placed) or sensor
    model = SkinModel(skin, ModelSettings(mesh=mesh, error_estimate=False))
    requests = [_press(reaches[course.tools[int(course.tool[r])].name], revised[r]) for r in rows]
    answers = PressStore.of(model).solve(requests, 1, progress)
    confirmed = []
    for r, press, answer in zip(rows, requests, answers, strict=True):
        name = course.tools[int(course.tool[r])].name
        at, depth = (float(revised[r, 0]), float(revised[r, 1])), float(press.depths[-1])
        # A press that ended early was not solved at the depth that is compared.
        if isinstance(answer, SolveError) or len(answer.depths) < len(press.depths):
            confirmed.append(Confirmed(name, at, depth, float(change[r]), float("nan"), float("nan"), False))
            continue
        reading = reading_of(sensor, answer.loads)
        # The last state: the depth of the row.
        true = reading.load(Loads(*(v[-1:] for v in vars(answer.loads).values())), Transducer.of(sensor))[0]
        wrong = np.abs(revised_loads[r] - true) / max(float(np.abs(true).max()), 1e-12)
        rms = float(np.sqrt(np.mean(wrong**2)))
        confirmed.append(Confirmed(name, at, depth, float(change[r]), rms, float(wrong.max()), True))
    return confirmed


def _factor(comparison: Comparison, effect: Placed, pose: np.ndarray) -> np.ndarray:
    """Return the factor of a mechanical effect on the loads of every row, shape (rows,)."""
    from tacdata.chain.state import State

    # What the effect makes of a load of 1 is its factor.
    ones = np.ones((len(pose), 1))
    state = State(comparison.course, comparison.setting.response, pose, ones, ones[:, 0], ones)
    return effect.act(state).load[:, 0]


def _spread(change: np.ndarray, site: np.ndarray, tool: np.ndarray, count: int) -> list[int]:
    """Return the rows of largest change, each at another place."""
    rows: list[int] = []
    used: set[tuple[int, int]] = set()
    for r in np.argsort(-change).tolist():
        key = (int(site[r]), int(tool[r]))
        if key in used or change[r] <= 0:
            continue
        used.add(key)
        rows.append(r)
        if len(rows) == count:
            break
    return rows


def _press(reach: Reach, pose: np.ndarray) -> PressRequest:
    depth = max(float(pose[2]), SHALLOW)
    states = max(int(np.ceil(np.sqrt(depth / SHALLOW))), 3)
    # Evenly spaced in the root of depth, where loads at first contact are smooth.
    depths = depth * (np.arange(states + 1) / states) ** 2
    x, y = (round(float(v), 4) for v in pose[:2])
    return PressRequest(reach.indenter, x, y, reach.yaw, tuple(round(float(d), 6) for d in depths), *reach.tilt)
