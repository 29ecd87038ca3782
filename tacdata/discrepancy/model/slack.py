"""One-sided contact: a strip that goes slack, or a tip that lifts off, before the depth at which it was touched.

Such readings are at rest whatever the skin remembers: they bound it from one side alone, as a clipped reading does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course

LONG = 0.05
"""A way at rest counts from this share of the press's depth on [1]."""
FEWEST_ROWS = 5
"""Rows at rest, at least."""
MANY = 0.5
"""Share of a place's presses that must have such a way [1]: one alone is an odd press."""
REST = 0.02
"""A reading is at rest within this share of a press's rise, or four times the noise of rows [1]."""
CLOSE = 0.1
"""A reading was loaded on the way down at the same depth by more than this share of the rise [1]."""


def without_slack(course: Course) -> Course:
    """Return the course with readings of slack left out, as clipped ones are, and a note where there are any."""
    slack = slack_rows(course)
    if not slack.any():
        return course
    presses = len(np.unique(course.episode[slack.any(axis=1)]))
    words = (
        f"one-sided contact: in {presses} presses readings are at rest on the way back before the depth of the first "
        "touch (slack, or lifted off); these are left out"
    )
    before = np.zeros_like(slack) if course.clipped is None else course.clipped
    return replace(course, clipped=before | slack, notes=(*course.notes, words))


def slack_rows(course: Course) -> np.ndarray:
    """Return which readings are at rest though the tip is deeper than where they began to rise, shape (n, channels)."""
    found = np.zeros(course.readings.shape, dtype=bool)
    read = course.averaged > 0
    rows_of = [np.flatnonzero((course.episode == k) & read) for k in range(course.episodes)]
    for channel in range(course.channels):
        each = [_of_press(course.tip[rows, 2], course.readings[rows, channel]) for rows in rows_of]
        there = np.array([own.any() for own in each])
        if there.mean() >= MANY:
            for rows, own in zip(rows_of, each, strict=True):
                found[rows[own], channel] = True
    return found


def _of_press(depth: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return which readings of a press are slack, shape (n,), bool."""
    none = np.zeros(len(values), dtype=bool)
    known = np.isfinite(values)
    if np.count_nonzero(known) < 4 * FEWEST_ROWS:
        return none
    top, idle = (
        int(np.argmax(depth)),
        float(np.median(values[:FEWEST_ROWS][known[:FEWEST_ROWS]] if known[:FEWEST_ROWS].any() else values[known])),
    )
    stroke = float(depth[top] - depth[0])
    rise = values - idle
    whole = float(np.nanmax(np.abs(rise)))
    noise = 1.4826 * float(np.nanmedian(np.abs(np.diff(values, 2)))) / np.sqrt(6)
    rest = max(REST * whole, 4 * noise)
    if stroke <= 0 or whole < 10 * rest or np.nanmin(rise * np.sign(rise[np.nanargmax(np.abs(rise))])) < -2 * rest:
        return none  # readings go beyond their rest: contact holds, or it is no contact
    down, back = np.arange(top + 1), np.arange(top + 1, len(values))
    order = np.argsort(depth[down], kind="stable")
    loaded = np.interp(depth[back], depth[down][order], np.abs(rise[down])[order])
    quiet = (np.abs(rise[back]) <= rest) & (loaded > CLOSE * whole)
    if np.count_nonzero(quiet) < FEWEST_ROWS or float(np.ptp(depth[back][quiet])) < LONG * stroke:
        return none
    # From the first row at rest on, every row on the way back is.
    none[back[int(np.flatnonzero(quiet)[0]) :]] = True
    return none & (np.abs(rise) <= 2 * rest)
