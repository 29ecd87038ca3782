"""Do all answers step within a session, in place, in strength or in height? Each press is compared with all others.

A regression explains the differences between presses by their depth, site, speed and indenter, and by a steady drift.
A step from one press on is a further column (the Chow test with an unknown break). Strength is the amplitude of the
answers. Height is the depth at which a share of a press's greatest answer is felt: it does not depend on gains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.plans import Press
from tacdata.recording.check.alignment import height_felt
from tacdata.recording.check.channel_order import Answers, counts_as_press, fit_answers
from tacdata.recording.check.figures import RecordingFigures

FEWEST = 4
"""Presses on both sides of a step, at least [count]."""
FREEDOM = 6
"""Presses beyond the columns of the regression that its residual spread needs [count]."""
SURE = 7.0
"""Minimum ratio of a step to its own standard error [1]; at most 4 in 300 sessions without one."""
SLIP = 0.5
"""Slip sideways that is reported [mm]."""
STRONGER = 0.18
"""Step of the logarithm of all answers that is reported [1]: a factor of 1.2."""
HIGHER = 0.06
"""Step of the height that is reported [mm]."""
INSIDE = 0.5
"""Distance of a press from the outermost taxels' centres, inwards, from which its centre of answer is used [mm]."""
TELLING = (0.7, 0.4)
"""Step of the logarithm of all answers [1], and of the height [mm], that a session should be able to show."""


@dataclass(frozen=True)
class AnswerStep:
    """A step of all answers."""

    row: int
    """Which of the answers comes first after it, from 0."""
    size: np.ndarray
    """Size [unit of the quantity], shape (quantities,)."""


@dataclass(frozen=True)
class StepSearch:
    """Result of a search for a step."""

    step: AnswerStep | None
    """The step, if there is a sure one."""
    smallest: float
    """Smallest step half-way through the session that would be sure; infinite if none would be."""


def find_step(explained: np.ndarray, values: np.ndarray, threshold: float) -> StepSearch:
    """Search for a step.

    Args:
        explained: Columns that explain the values otherwise, shape (presses, columns).
        values: Measured quantities, shape (presses, quantities).
        threshold: Smallest step that is reported [unit of the values].
    """
    count, best, middle = len(values), None, np.inf
    for at in range(FEWEST, count - FEWEST + 1):
        step = (np.arange(count) >= at).astype(float)
        # Only the part of the step that no other column explains determines its size (Frisch, Waugh and Lovell).
        remainder = step - explained @ np.linalg.lstsq(explained, step, rcond=None)[0]
        design = np.column_stack([explained, step])
        freedom = count - int(np.linalg.matrix_rank(design))
        if freedom < FREEDOM or remainder @ remainder < 1e-6 * count:
            continue
        solved = np.linalg.lstsq(design, values, rcond=None)[0]
        spread = ((values - design @ solved) ** 2).sum(axis=0) / freedom
        error = np.maximum(np.sqrt(spread / (remainder @ remainder)), 1e-9)
        significance = float((np.abs(solved[-1]) / error).max())
        if best is None or significance > best[0]:
            best = significance, at, solved[-1]
        # Half-way through the session both sides have most presses, so a step is most certain there.
        middle = min(middle, SURE * float(error.max())) if abs(at - count / 2) <= 1 else middle
    if best is None or best[0] < SURE or np.abs(best[2]).max() < threshold:
        return StepSearch(None, middle)
    return StepSearch(AnswerStep(best[1], best[2]), middle)


def slip(sample: Answers) -> AnswerStep | None:
    """Return from which press on the answers lie elsewhere, and where [mm, sensor frame]; None if they do not."""
    centers = sample.taxels.centers
    low, high = centers.min(axis=0) + INSIDE, centers.max(axis=0) - INSIDE
    rows = np.flatnonzero(np.all((sample.sites > low) & (sample.sites < high), axis=1))
    # Squared: the noise of the many taxels around the contact must not pull its centre.
    weight = np.maximum(sample.response[rows], 0.0) ** 2
    total = weight.sum(axis=1)
    if len(rows) < 2 * FEWEST or not total.all():
        return None
    sites = sample.sites[rows]
    offset = (weight[:, :, None] * centers).sum(axis=1) / total[:, None] - sites
    # Answers end at the array's rim, which draws their centre inwards in proportion to the site.
    step = find_step(np.column_stack([np.ones(len(rows)), sites]), offset, SLIP).step
    return None if step is None else AnswerStep(int(rows[step.row]), step.size)


def strength_step(entries: list[RecordingFigures], sample: Answers) -> StepSearch:
    """Search for a step of the logarithm of all answers."""
    presses = [entry.recording.episode.press for entry in entries if counts_as_press(entry)]
    amplitude = fit_answers(sample).amplitude
    rows = np.flatnonzero(amplitude > 0)
    if len(rows) < 2:
        return StepSearch(None, np.inf)
    # Answers grow by a power of depth, which is a line in logarithms; the square allows for saturation.
    depth = np.log([presses[k].depth for k in rows])
    explained = np.column_stack([_explained([presses[k] for k in rows]), depth, depth**2])
    return _back(find_step(explained, np.log(amplitude[rows])[:, None], STRONGER), rows)


def height_step(entries: list[RecordingFigures]) -> StepSearch:
    """Search for a step of the height at which the skin is felt [mm], positive if it is felt deeper."""
    pressed = [entry for entry in entries if counts_as_press(entry)]
    heights = [height_felt(entry) for entry in pressed]
    rows = np.array([k for k, height in enumerate(heights) if height is not None], int)
    if not len(rows):
        return StepSearch(None, np.inf)
    presses = [pressed[k].recording.episode.press for k in rows]
    depth = np.array([press.deepest for press in presses])
    values = np.array([heights[k] for k in rows], float)
    return _back(find_step(np.column_stack([_explained(presses), depth]), values[:, None], HIGHER), rows)


def _back(search: StepSearch, rows: np.ndarray) -> StepSearch:
    """Count presses among all that were used, not among those in which the quantity is known."""
    if search.step is None:
        return search
    return StepSearch(AnswerStep(int(rows[search.step.row]), search.step.size), search.smallest)


def _explained(presses: list[Press]) -> np.ndarray:
    """Return the columns for site, time, speed and kind of press, scaled to about 1, shape (presses, columns)."""
    kinds = [(p.mounting, p.approach_from, p.overshoot > 0, p.strokes > 0) for p in presses]
    table = np.array([(p.x, p.y, np.log(p.speed), p.overshoot) for p in presses], float)
    table = (table - table.mean(axis=0)) / np.maximum(table.std(axis=0), 1e-9)
    each = [[float(kind == category) for category in sorted(set(kinds))] for kind in kinds]
    # The last column is a drift over the session, which is no step.
    return np.column_stack([each, table, table[:, :2] ** 2, np.linspace(-1.0, 1.0, len(presses))])
