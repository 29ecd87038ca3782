"""Single channels that jump, wander or change places during a session: no effect of the library does so."""

from __future__ import annotations

import numpy as np

from tacdata.chain import Course, Response, predict

STRONG = 0.2
"""A channel counts in a press that stirs it by this share of its largest rise [1]."""
FEWEST = 10
"""Presses in which a channel is watched, at least."""
LEAST_JUMP, LEAST_WANDER = 0.08, 0.04
"""Changes of a gain that are reported [1]..."""
JUMP_Z, WANDER_Z = 6.0, 8.0
"""...from so many times the scatter from press to press on [1]."""
SHARED = 0.4
"""A change of which the other channels show so much is no single channel's [1]."""
CLEAR = 10.0
"""A slope over depth has a sign from so many times its noise on [1]."""
RUN = 3
"""Successive presses of a jump, or of a change of places, at least."""
SWAPPED = 0.3
"""Two channels changed places where that leaves so much of the misfit, or less [1]."""
MOST_LISTED = 4


def odd_channels(course: Course, response: Response) -> list[str]:
    """Return in words which channels differ from themselves during the session.

    Args:
        course: The recordings.
        response: Expected response of the channels to presses.
    """
    reduced, predicted = course.reduced, predict(course, response, []).signal[course.read]
    episodes = np.unique(reduced.episode)
    if len(episodes) < FEWEST:
        return []
    rows = [np.flatnonzero(reduced.episode == e) for e in episodes]
    measured = [risen(reduced.readings[r]) for r in rows]
    expected = [risen(predicted[r]) for r in rows]
    swapped = _swaps(course, episodes, measured, expected)
    inversions = _turned(course, episodes, rows, measured)
    excluded, places = {*inversions, *(c for pair in swapped for c in pair)}, [*inversions.values(), *swapped.values()]
    gains = press_gains(measured, expected)
    return [*places, *_jumps_and_wanders(course, episodes, gains, excluded)][:MOST_LISTED]


def risen(values: np.ndarray) -> np.ndarray:
    """Return a press's readings above those that it begins with, shape (n, channels)."""
    return values - np.nanmedian(values[: max(len(values) // 10, 1)], axis=0)


def _turned(course: Course, episodes: np.ndarray, rows: list[np.ndarray], measured: list[np.ndarray]) -> dict[int, str]:
    """Return which channels have the other sign from a press on, each with words.

    A fitted response is of no help: it follows the mean of both signs. Slopes over depth are compared at each place.
    """
    readings, depth = [np.nan_to_num(m) for m in measured], course.reduced.tip[:, 2]
    # About its mean: a press may begin with friction already.
    ways = [depth[r] - depth[r].mean() for r in rows]
    peak = np.array([m.T @ way / max(float(np.linalg.norm(way)), 1e-9) for m, way in zip(readings, ways, strict=True)])
    place, steps = course.site[episodes], np.concatenate([np.abs(np.diff(m, axis=0)) for m in readings])
    # A step between two readings has twice the variance of a reading's noise.
    noise = 1.4826 * np.median(steps, axis=0) / np.sqrt(2)
    words = {}
    for channel, heights in enumerate(peak.T):
        strong = np.flatnonzero(np.abs(heights) >= max(STRONG * np.abs(heights).max(), CLEAR * noise[channel]))
        first = {p: np.sign(heights[k]) for k, p in reversed([(k, place[k]) for k in strong])}
        same = np.array([np.sign(heights[k]) == first[place[k]] for k in strong])
        change = int(np.argmin(same)) if not same.all() else len(same)
        if change >= RUN and len(same) - change >= RUN and not same[change:].any():
            words[channel] = (
                f"{course.channel_names[channel]}: reads with the other sign from "
                f"{course.names[int(episodes[strong[change]])]} on: was its lead turned, or a setting changed?"
            )
    return words


def press_gains(measured: list[np.ndarray], expected: list[np.ndarray]) -> np.ndarray:
    """Return each channel's gain in each press [1], shape (presses, channels); NaN where a press hardly stirs it."""
    power = np.array([np.nansum(np.square(p), axis=0) for p in expected])
    products = np.array([np.nansum(m * p, axis=0) for m, p in zip(measured, expected, strict=True)])
    peak = np.array([np.abs(p).max(axis=0) for p in expected])
    # A channel that no press stirs has no gain.
    strong = (peak >= STRONG * peak.max(axis=0)) & (power > 0)
    gains = np.where(strong, products / np.where(strong, power, 1.0), np.nan)
    usual = np.full(gains.shape[1], np.nan)
    stirred = strong.any(axis=0)
    usual[stirred] = np.nanmedian(gains[:, stirred], axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return gains / usual


def _jumps_and_wanders(course: Course, episodes: np.ndarray, gains: np.ndarray, left_out: set[int]) -> list[str]:
    words: list[tuple[float, str]] = []
    if gains.shape[1] < 2:
        return []  # a channel without others cannot be compared: a change over the session may be an effect
    for channel in range(gains.shape[1]):
        presses = np.flatnonzero(np.isfinite(gains[:, channel]))
        if len(presses) < FEWEST or channel in left_out:
            continue
        series, name = gains[presses, channel], course.channel_names[channel]
        typical = _others(gains, channel)[presses]
        # The difference of two presses has twice the variance of one.
        scatter = float(1.4826 * np.median(np.abs(np.diff(series) - np.median(np.diff(series)))) / np.sqrt(2))
        begin, end = _longest(np.abs(series - 1) > max(LEAST_JUMP, JUMP_Z * scatter))
        change = float(np.median(series[begin:end])) - 1 if end > begin else 0.0
        if RUN <= end - begin <= len(series) // 2 and abs(np.median(typical[begin:end]) - 1) < SHARED * abs(change):
            first, last = (course.names[int(episodes[presses[k]])] for k in (begin, end - 1))
            healed = "and comes back" if end < len(series) else "to the end"
            words.append(
                (
                    abs(change),
                    (
                        f"{name}: reads {100 * abs(change):.0f} % {'more' if change > 0 else 'less'} "
                        f"from {first} to {last} "
                        f"{healed}: look at its contact, or leave these presses out"
                    ),
                )
            )
            continue
        spread = float(np.ptp(_smooth(series)))
        # `_smooth` takes five presses together, so chance is smaller by the root of five.
        if spread > max(LEAST_WANDER, WANDER_Z * scatter / np.sqrt(5)) and np.ptp(_smooth(typical)) < SHARED * spread:
            words.append(
                (
                    spread,
                    (
                        f"{name}: its gain wanders by {100 * spread:.0f} % over the session, unlike the others': "
                        "look at its contact and its cable"
                    ),
                )
            )
    return [sentence for _, sentence in sorted(words, reverse=True)]


def _others(gains: np.ndarray, channel: int) -> np.ndarray:
    """Return the median gain of all other channels [1], shape (presses,); 1 where none is stirred."""
    remainder = np.delete(gains, channel, axis=1)
    stirred = np.isfinite(remainder).any(axis=1)
    result = np.ones(len(gains))
    result[stirred] = np.nanmedian(remainder[stirred], axis=1)
    return result


def _smooth(values: np.ndarray) -> np.ndarray:
    return np.array([np.median(values[max(k - 2, 0) : k + 3]) for k in range(len(values))])


def _longest(flags: np.ndarray) -> tuple[int, int]:
    """Return the longest run of flags as begin and end."""
    best, begin = (0, 0), 0
    for k, flag in enumerate([*flags, False]):
        if not flag:
            best, begin = ((begin, k) if k - begin > best[1] - best[0] else best), k + 1
    return best


def _swaps(
    course: Course, episodes: np.ndarray, measured: list[np.ndarray], expected: list[np.ndarray]
) -> dict[tuple[int, int], str]:
    """Return which two channels changed places in a part of the session, each pair with words."""
    words, channels = {}, course.channels
    cross = (
        np.array(
            [
                [[np.nansum(np.square(m[:, i] - p[:, j])) for j in range(channels)] for i in range(channels)]
                for m, p in zip(measured, expected, strict=True)
            ]
        )
        if channels <= 32
        else np.zeros((0, 0, 0))
    )
    for i in range(len(cross) and channels):
        for j in range(i + 1, channels):
            straight, crossed = cross[:, i, i] + cross[:, j, j], cross[:, i, j] + cross[:, j, i]
            begin, end = _longest(crossed < SWAPPED * straight)
            outside = np.ones(len(straight), dtype=bool)
            outside[begin:end] = False
            if (
                end - begin >= RUN
                and outside.sum() >= RUN
                and straight[outside].sum() < SWAPPED * crossed[outside].sum()
            ):
                first, last = (course.names[int(episodes[k])] for k in (begin, end - 1))
                names = course.channel_names
                words[i, j] = (
                    f"{names[i]} and {names[j]} read as one another from {first} to {last}: were they swapped? "
                    "Touch one taxel after the other"
                )
    return words
