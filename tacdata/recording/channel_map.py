"""Whether the channels are where the sensor file says: each answers most to presses on its own taxel."""

from __future__ import annotations

import numpy as np

from tacdata.recording.check_figures import Figures

PRESSES = 16
"""Presses from which the question can be asked [count]."""
REACH = 2.0
"""Width of what a press stirs [mm]: of the Gaussian against which answers are held."""
CLEAR = 0.25
"""How much better another place must explain a channel's answers [1, correlation]."""
FAR = 1.5
"""How far that place must be from the channel's own [pitches]; direct neighbours cannot be told apart so."""
SILENT = 6.0
"""Answer to a press close by that a working channel exceeds [times its noise]."""


def misplaced(recordings: list[Figures]) -> dict[int, int]:
    """Return the channels that answer like another taxel, with that taxel; {} with too few presses to say."""
    response, expected = _tables(recordings)
    if len(response) < PRESSES:
        return {}
    taxels = recordings[0].recording.episode.sensor.taxels
    correlation = _correlate(response, expected)
    pitch = np.array([taxels.pitch_x, taxels.pitch_y])
    distance = np.linalg.norm((taxels.centers[:, None] - taxels.centers) / pitch, axis=-1)
    found = {}
    for channel in range(taxels.count):
        best = (
            int(np.nanargmax(correlation[channel])) if not np.isnan(correlation[channel]).all() else channel
        )
        gain = correlation[channel, best] - np.nan_to_num(correlation[channel, channel], nan=-1.0)
        if gain > CLEAR and distance[channel, best] > FAR:
            found[channel] = best
    return found


def silent(recordings: list[Figures]) -> list[int]:
    """Return the channels that did not answer to any press close by, while others did."""
    response, expected = _tables(recordings)
    if not len(response):
        return []
    noise = np.array(
        [
            [np.nan if v is None else v for v in f.document["taxels"]["idle_noise"]]
            for f in recordings
            if _whole(f)
        ]
    )
    threshold = SILENT * np.maximum(np.nanmedian(noise, axis=0), 0.5)
    close = expected > 0.75 * expected.max()
    answered = (np.abs(response) > threshold) & close
    others = answered.any()
    return [
        k for k in range(response.shape[1]) if others and close[:, k].sum() >= 2 and not answered[:, k].any()
    ]


def _whole(figures: Figures) -> bool:
    press, response = figures.recording.episode.press, figures.document["taxels"]["response"]
    return press.depth > 0.2 and None not in response


def _tables(recordings: list[Figures]) -> tuple[np.ndarray, np.ndarray]:
    """Return answers [counts] and what a Gaussian around each press expects [mm], both (presses, taxels)."""
    response, expected = [], []
    for figures in filter(_whole, recordings):
        episode = figures.recording.episode
        apart = np.linalg.norm(episode.sensor.taxels.centers - [episode.press.x, episode.press.y], axis=1)
        response.append(figures.document["taxels"]["response"])
        expected.append(episode.press.depth * np.exp(-(apart**2) / (2 * REACH**2)))
    return np.array(response, dtype=float), np.array(expected, dtype=float)


def _correlate(response: np.ndarray, expected: np.ndarray) -> np.ndarray:
    a, b = response - response.mean(axis=0), expected - expected.mean(axis=0)
    norm = np.linalg.norm(a, axis=0)[:, None] * np.linalg.norm(b, axis=0)[None]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(norm > 0, a.T @ b / norm, np.nan)
