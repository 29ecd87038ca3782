"""Tests whether the channels are placed as in the sensor file, and whether their gain steps.

Every press excites the taxels around its site, less with distance and equally in all directions. So the answers of a
session fit ``gain of channel * amplitude of press * exp(-distance^2 / 2 width^2)``. A channel that is wired to another
place fits better there than at its own. One whose gain steps leaves the fit from some press on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from tacdata.recording.check.figures import RecordingFigures
from tacdata.sensor.sensor import Taxels

PRESSES = 10
"""Presses needed for testing the order [count]."""
STEP_PRESSES = 16
"""Presses needed for telling a gain step from chance [count]."""
DEPTH = 0.15
"""Depth from which a press counts [mm]."""
WIDTHS = np.linspace(1.0, 4.0, 13)
"""Widths tried for the area that an indenter excites [mm]."""
ROUNDS = 4
"""Passes in which width, amplitudes and gains are fitted in turn [count]."""
CLEAR = 8.0
"""Minimum gain in log-likelihood by which another place must explain a channel's answers [1]."""
STEP = 0.25
"""Minimum gain step that is reported [1]."""
SURE = 7.0
"""... and minimum ratio to its own standard error [1]."""
NEAR = 0.15
"""Share of a press's strongest answer from which a channel counts as near it [1]."""
SIDE = 2
"""Presses that a channel must have answered on both sides of a step [count]."""
SILENT = 6.0
"""Answer to a near press that a working channel exceeds [times its noise]."""


@dataclass(frozen=True)
class Answers:
    """Answers of each channel to each press of a session, in the order of recording."""

    response: np.ndarray
    """Change from rest to hold [counts], shape (presses, taxels)."""
    sites: np.ndarray
    """Places of the presses [mm, sensor frame], shape (presses, 2)."""
    indenters: np.ndarray
    """Name and angles of each press's indenter [text], shape (presses,)."""
    noise: np.ndarray
    """Noise of each channel [counts], shape (taxels,)."""
    taxels: Taxels

    @property
    def distance(self) -> np.ndarray:
        """Distance of every press from every taxel [mm], shape (presses, taxels)."""
        return np.linalg.norm(self.sites[:, None] - self.taxels.centers, axis=-1)


def answers(recordings: list[RecordingFigures], least: float = 0.5) -> Answers | None:
    """Collect the answers of a session's complete presses, with a least noise [counts]; None if there are none."""
    presses = [f for f in recordings if counts_as_press(f)]
    if not presses:
        return None
    episodes = [f.recording.episode for f in presses]
    noise = np.array([[np.nan if v is None else v for v in f.document["taxels"]["idle_noise"]] for f in presses], float)
    mask = ~np.isnan(noise).all(axis=0)
    middle = np.full(noise.shape[1], np.nan)
    middle[mask] = np.nanmedian(noise[:, mask], axis=0)
    return Answers(
        np.array([[0.0 if v is None else v for v in f.document["taxels"]["response"]] for f in presses]),
        np.array([(e.press.x, e.press.y) for e in episodes]),
        np.array([f"{e.press.indenter_name} {e.press.turned}" for e in episodes]),
        np.maximum(np.nan_to_num(middle, nan=1.0), least),
        episodes[0].sensor.taxels,
    )


def counts_as_press(figures: RecordingFigures) -> bool:
    """Whether a recording is a press deep enough to be used."""
    press, response = figures.recording.episode.press, figures.document["taxels"]["response"]
    return press.depth > DEPTH and any(value is not None for value in response)


@dataclass(frozen=True)
class AnswerFit:
    """Fitted gains, amplitudes and widths."""

    gain: np.ndarray
    """Gain of each channel relative to the others [1], shape (taxels,)."""
    pattern: np.ndarray
    """Predicted answer of a channel of gain 1 at each place [counts], shape (presses, taxels)."""
    amplitude: np.ndarray
    """Predicted answer of a channel of gain 1 below the indenter [counts], shape (presses,)."""


def fit_answers(sample: Answers, place: np.ndarray | None = None) -> AnswerFit:
    """Fit the answers robustly, with channel k at place ``place[k]`` (default: its own)."""
    place = np.arange(sample.response.shape[1]) if place is None else place
    response, squared = sample.response, sample.distance[:, place] ** 2
    gain, pattern, amplitude = np.ones(response.shape[1]), np.zeros_like(response), np.zeros(len(response))
    weight = np.ones_like(response)
    # Alternating least squares: shapes with given gains, then gains with given shapes, with outliers weighted down.
    for _ in range(ROUNDS):
        for name in np.unique(sample.indenters):
            rows = sample.indenters == name
            fits = [
                _amplitudes(response[rows], np.exp(-squared[rows] / (2 * w**2)) * gain, weight[rows]) for w in WIDTHS
            ]
            best = int(np.argmin([misfit for _, misfit in fits]))
            shape = np.exp(-(sample.distance[rows] ** 2) / (2 * WIDTHS[best] ** 2))
            amplitude[rows], pattern[rows] = fits[best][0], fits[best][0][:, None] * shape
        expected = pattern[:, place]
        weight = _trust(response - expected * gain, sample.noise)
        raw = (weight * response * expected).sum(axis=0) / np.maximum((weight * expected**2).sum(axis=0), 1e-12)
        # Gains and amplitudes share one free factor: the median gain is set to 1.
        gain = np.clip(raw / max(float(np.median(raw)), 1e-12), 0.2, 5.0)
    return AnswerFit(gain, pattern, amplitude)


def _amplitudes(response: np.ndarray, shape: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, float]:
    amplitude = (weight * response * shape).sum(axis=1) / np.maximum((weight * shape**2).sum(axis=1), 1e-12)
    return amplitude, float((weight * (response - amplitude[:, None] * shape) ** 2).sum())


def _trust(residual: np.ndarray, noise: np.ndarray) -> np.ndarray:
    # 1.5 median |r| estimates the standard deviation of a Gaussian; Cauchy weights reduce outliers beyond three of it.
    scale = np.maximum(1.5 * np.median(np.abs(residual), axis=1, keepdims=True), noise)
    return 1 / (1 + (residual / (3 * scale)) ** 2)


def misplaced(sample: Answers) -> dict[int, int]:
    """Return the channels that answer like another taxel, with that taxel; {} with too few presses."""
    if len(sample.response) < PRESSES:
        return {}
    # A plug that is turned permutes all channels at once. Such orders are tried as a whole, since most channels are
    # then wrong.
    score = max((likelihood(sample, fit_answers(sample, place).pattern) for place in orders(sample.taxels)), key=_best)
    # A wrong channel spoils the fit that the others are compared with. So channels that fit elsewhere are moved there,
    # and all are tested again.
    _, place = linear_sum_assignment(-score)
    return exchanged(likelihood(sample, fit_answers(sample, place).pattern))


def exchanged(score: np.ndarray) -> dict[int, int]:
    """Return the channels that fit at another's place, with that place.

    Args:
        score: Log-likelihood of each channel at each place (`likelihood`), shape (taxels, taxels).
    """
    diagonal = np.diag(score)
    _, place = linear_sum_assignment(-score)
    gain = score[np.arange(len(diagonal)), place] - diagonal
    # Channels exchange places in cycles, so each channel of the cycle has to fit better.
    return {
        k: int(j) for k, j in enumerate(place) if j != k and gain[k] > CLEAR and _cycle_gain(place, gain, k) > CLEAR
    }


def orders(taxels: Taxels) -> list[np.ndarray]:
    """Return the usual orders of a plug: correct, turned by 180 deg, and mirrored."""
    grid = np.arange(taxels.count).reshape(taxels.rows, taxels.columns)
    return [order.ravel() for order in (grid, grid[::-1, ::-1], grid[:, ::-1], grid[::-1])]


def _best(score: np.ndarray) -> float:
    return float(score[linear_sum_assignment(-score)].sum())


def _cycle_gain(place: np.ndarray, gain: np.ndarray, start: int) -> float:
    """Return the smallest log-likelihood gain among the channels that change places with ``start``."""
    smallest, at = gain[start], int(place[start])
    while at != start:
        smallest, at = min(smallest, gain[at]), int(place[at])
    return float(smallest)


def likelihood(sample: Answers, pattern: np.ndarray) -> np.ndarray:
    """Return the log-likelihood of each channel at each place, with a gain of its own, shape (taxels, taxels)."""
    response, count = sample.response, len(sample.response)
    scale = np.maximum(np.abs(pattern).max(axis=1, keepdims=True), 1e-12)  # deep presses must not outweigh all others
    a, b = response / scale, pattern / scale
    # Without a floor, channels that answer to nothing fit everywhere without a misfit. 2 % is the error of the pattern
    # itself.
    floor = count * (np.median(sample.noise / np.median(scale)) ** 2 + 0.02**2)
    power = (a**2).sum(axis=0)[:, None]
    # A gain is positive: answers of the opposite sign explain nothing.
    shared = np.maximum(a.T @ b, 0.0) ** 2 / np.maximum((b**2).sum(axis=0), 1e-12)
    return -0.5 * count * np.log((power - shared + floor) / (power + floor))


def gain_steps(sample: Answers) -> dict[int, tuple[int, float]]:
    """Return the channels whose gain steps: the press before which it does, and the factor."""
    if len(sample.response) < STEP_PRESSES:
        return {}
    pattern = fit_answers(sample).pattern
    # Far from a press, noise decides the ratio.
    near = _near(sample, pattern)
    ratio = np.full(pattern.shape, np.nan)
    # A gain is a factor; in logarithms its step is additive.
    ratio[near] = np.log(np.clip(sample.response[near] / pattern[near], 0.05, 20.0))
    ratio -= _common(sample, ratio)
    centers = np.array([np.median(c[np.isfinite(c)]) if np.isfinite(c).any() else 0.0 for c in ratio.T])
    usual = 1.4826 * float(np.median(np.abs(ratio - centers)[near])) if near.any() else 0.0
    scatter = _scatter(sample, ratio - centers, usual)
    steps = {}
    for channel in range(ratio.shape[1]):
        rows = np.flatnonzero(near[:, channel])
        step = _step(ratio[rows, channel], scatter[rows])
        if step is not None:
            steps[channel] = (int(rows[step[0]]), float(np.exp(step[1])))
    return steps


def _near(sample: Answers, pattern: np.ndarray) -> np.ndarray:
    """Return which presses are near which channels, shape (presses, taxels), bool."""
    return (pattern > NEAR * pattern.max(axis=1, keepdims=True)) & (pattern > SILENT * sample.noise)


def unknown_gains(sample: Answers) -> list[int]:
    """Return the channels with too few presses near them for telling a step of their gain."""
    near = _near(sample, fit_answers(sample).pattern).sum(axis=0)
    return np.flatnonzero(near < 2 * SIDE).tolist()


def _common(sample: Answers, ratio: np.ndarray) -> np.ndarray:
    """Return the residual that all channels share: an indenter's answer is not Gaussian, and deep presses saturate."""
    shared = np.zeros_like(ratio)
    offsets = np.zeros(ratio.shape[1])
    distance = sample.distance
    for _ in range(3):
        for name in np.unique(sample.indenters):
            rows = sample.indenters == name
            use = np.isfinite(ratio) & rows[:, None]
            if use.sum() < 12:
                continue
            # A cubic in distance describes how an indenter's answer deviates from the Gaussian.
            terms = np.stack([np.ones_like(distance), distance, distance**2, distance**3], axis=-1)
            target = (ratio - offsets)[use]
            weight = np.ones(len(target))
            for _ in range(3):
                fitted = np.linalg.lstsq(terms[use] * weight[:, None], target * weight, rcond=None)[0]
                residual = target - terms[use] @ fitted
                weight = 1 / np.sqrt(1 + (residual / (2 * np.median(np.abs(residual)) + 1e-9)) ** 2)
            shared[rows] = (terms @ fitted)[rows]
        remainder = ratio - shared
        # A press that excites more or less than its fit does so for all channels near it.
        level = np.array(
            [np.median(row[np.isfinite(row)]) if np.isfinite(row).any() else 0.0 for row in remainder - offsets]
        )
        shared += level[:, None]
        offsets = np.array([np.median(c[np.isfinite(c)]) if np.isfinite(c).any() else 0.0 for c in (ratio - shared).T])
    return shared


def _scatter(sample: Answers, residuals: np.ndarray, usual: float) -> np.ndarray:
    """Return the scatter of every press's residuals [1], shape (presses,).

    An indenter that is not round fits worse. Presses of one indenter often follow each other, and its misfit must not
    pass for a step.
    """
    scatter = np.full(len(residuals), max(usual, 0.03))
    for name in np.unique(sample.indenters):
        rows = sample.indenters == name
        values = residuals[rows][np.isfinite(residuals[rows])]
        if len(values):
            scatter[rows] = np.maximum(scatter[rows], np.sqrt(np.mean(np.square(values))))
    return scatter


def _step(values: np.ndarray, usual: np.ndarray) -> tuple[int, float] | None:
    """Return where values step and by how much, or None without a significant step; ``usual``: scatter of each, shape
    (n,).
    """
    best: tuple[float, int, float] | None = None
    # Each side needs some presses, or one odd press is a step.
    for at in range(SIDE, len(values) - SIDE + 1):
        head, tail = values[:at], values[at:]
        change = float(np.median(tail) - np.median(head))
        # Standard deviation on either side: an answer after the step that is as before speaks against it.
        variance = sum(
            max(float(np.var(side, ddof=1)), float(np.mean(np.square(scatter)))) / len(side)
            for side, scatter in ((head, usual[:at]), (tail, usual[at:]))
        )
        significance = abs(change) / np.sqrt(variance)
        if best is None or significance > best[0]:
            best = significance, at, change
    if best is None or best[0] < SURE or abs(best[2]) < np.log1p(STEP):
        return None
    return best[1], best[2]


def silent(sample: Answers) -> list[int]:
    """Return the channels that did not answer to any near press, while others did."""
    close = sample.distance < 0.75 * max(sample.taxels.pitch_x, sample.taxels.pitch_y)
    answered = (np.abs(sample.response) > SILENT * sample.noise) & close
    if not answered.any():
        return []
    return [k for k in range(sample.response.shape[1]) if close[:, k].sum() >= 2 and not answered[:, k].any()]


def unanswered(sample: Answers) -> bool:
    """Whether at least two presses close to taxels excited no channel at all."""
    close = (sample.distance < 0.75 * max(sample.taxels.pitch_x, sample.taxels.pitch_y)).any(axis=1)
    return bool(close.sum() >= 2 and not (np.abs(sample.response[close]) > SILENT * sample.noise).any())
