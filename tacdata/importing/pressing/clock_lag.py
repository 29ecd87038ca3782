"""Two clocks that do not agree: readings that lead or lag the position, or drift away from it."""

from dataclasses import dataclass

import numpy as np

from tacdata.importing.streams import Stream


@dataclass(frozen=True)
class LagPolicy:
    """Limits of clocks that agree.

    ``full_gain`` and ``other_gain`` were set on 30 virtual labs whose skins relax or creep. A shift gains at most 0.11
    there, and never leads to a correlation of 0.97. No other limit was tuned on data.
    """

    windows: int = 8
    """Parts of a recording in each of which the lag is found [count]."""
    rows: int = 50
    """Fewest rows of a part [rows]."""
    sparse: float = 20.0
    """Largest ratio of a recording's length to that of its rows without gaps [1]."""
    largest: float = 5.0
    """Largest lag that is looked for [s]."""
    share: float = 0.25
    """Largest lag that is looked for [a part's length]."""
    least_correlation: float = 0.9
    """Smallest correlation of readings and position, once they are shifted [1]."""
    full_correlation: float = 0.97
    """Correlation from which a shift explains all of the difference [1]."""
    full_gain: float = 0.05
    """Smallest gain of correlation by such a shift [1]."""
    other_gain: float = 0.2
    """Smallest gain of correlation by any other shift [1]."""
    period: float = 0.02
    """Largest difference of correlation between shifts by whole periods of a motion [1]."""
    lead: float = 0.1
    """Smallest lead that no skin has [s]."""
    lag: float = 0.5
    """Smallest lag that is reported [s]; filters and skins have shorter ones."""
    steps: float = 3.0
    """Smallest lead, lag or change of it [rows]."""
    straight: float = 0.9
    """Smallest share of the lags' variance that an even drift explains [1]."""
    parts: int = 4
    """Fewest parts of an even drift [count]."""


POLICY = LagPolicy()


def lag_doubts(taxels: Stream, position: Stream, policy: LagPolicy = POLICY) -> tuple[str, ...]:
    """Return a doubt about two clocks by which readings and position do not fit, as a sentence; () if they fit.

    Args:
        taxels: The channels, with a clock of their own.
        position: The path, with another clock.
        policy: The limits.
    """
    begin, end = (max(taxels.time_ns[0], position.time_ns[0]), min(taxels.time_ns[-1], position.time_ns[-1]))
    step = max(float(np.median(np.diff(stream.time_ns))) for stream in (taxels, position))
    if step <= 0 or (end - begin) / step < policy.rows:
        return ()
    if (end - begin) / step > policy.sparse * min(len(taxels.time_ns), len(position.time_ns)):
        return ()  # a gap, as of a clock that jumps, would fill the memory
    grid = np.arange(begin, end, step)
    path = position.values[:, int(np.argmax(np.ptp(position.values, axis=0)))]
    path = np.interp(grid, position.time_ns, path)
    answer = _answer(taxels, grid)
    count = int(min(policy.windows, len(grid) // policy.rows))
    most = int(min(policy.largest * 1e9 / step, policy.share * len(grid) / count))
    # A part without most of a stroke tells no lag.
    found = [
        _lag(a, b, most)
        for a, b in zip(np.array_split(path, count), np.array_split(answer, count), strict=True)
        if np.ptp(a) > 0.5 * np.ptp(path) and np.ptp(b) > 0
    ]
    found = [each for each in found if each[1] >= policy.least_correlation]
    if not found:
        return ()
    lags = np.array([each[0] for each in found]) * step / 1e9
    gains = np.array([each[1] - each[2] for each in found])
    least = policy.steps * step / 1e9
    if (drift := _drift(lags, policy)) and abs(drift) > least:
        return (
            f"position: its clock and that of the channels drift apart: the readings' lag changes by {drift:+.3g} s in "
            "the course of the recording: give drift [ppm] under the time of one",
        )
    lag, gain, correlation = (float(np.median(each)) for each in (lags, gains, [each[1] for each in found]))
    is_shift = gain >= policy.other_gain or (gain >= policy.full_gain and correlation >= policy.full_correlation)
    if not is_shift or abs(lag) < max(least, policy.lead if lag < 0 else policy.lag):
        return ()
    words = f"come {-lag:.3g} s before" if lag < 0 else f"come {lag:.3g} s behind"
    return (
        f"position: the readings {words} it, and its clock is another than theirs: have both one zero? Else give "
        "offset [s] under the time of one",
    )


def _answer(taxels: Stream, grid: np.ndarray) -> np.ndarray:
    """Return the common course of the channels at times [ns], shape (n,), whatever their signs and sizes."""
    columns = []
    for column in taxels.values.T:
        valid = np.isfinite(column)
        if valid.sum() > 1 and np.ptp(column[valid]) > 0:
            series = np.interp(grid, taxels.time_ns[valid], column[valid])
            columns.append((series - series.mean()) / (series.std() or 1.0))
    if not columns:
        return np.zeros(len(grid))
    table = np.stack(columns, axis=1)
    _, vectors = np.linalg.eigh(table.T @ table)
    return table @ vectors[:, -1]


def _lag(path: np.ndarray, answer: np.ndarray, most: int) -> tuple[int, float, float]:
    """Return the rows by which an answer lags a path, its correlation with it then, and that without a shift."""

    def correlation(lag: int) -> float:
        a, b = (path[: len(path) - lag], answer[lag:]) if lag >= 0 else (path[-lag:], answer[:lag])
        spread = float(a.std() * b.std())
        # Readings may fall under load: the sign does not matter.
        return abs(float(((a - a.mean()) * (b - b.mean())).mean())) / spread if spread > 0 else 0.0

    correlations = {lag: correlation(lag) for lag in sorted(range(-most, most + 1), key=abs)}
    largest = max(correlations.values())
    # The shortest shift of those that fit: presses that repeat fit again after a whole period.
    best = next(lag for lag, value in correlations.items() if value >= largest - POLICY.period)
    near = [lag for lag in correlations if abs(lag - best) <= most / 4]
    best = max(near, key=lambda lag: correlations[lag])
    return best, correlations[best], correlations[0]


def _drift(lags: np.ndarray, policy: LagPolicy) -> float:
    """Return the change of lags that grow or fall evenly from part to part [s]; 0 if they do not."""
    # A lag that outgrows the search spoils the last parts: an even drift may do without them.
    for count in range(len(lags), policy.parts - 1, -1):
        part = lags[:count]
        numbers = np.arange(count)
        slope, first = np.polyfit(numbers, part, 1)
        spread = float(part.var())
        if spread > 0 and 1 - float(np.mean((part - first - slope * numbers) ** 2)) / spread >= policy.straight:
            return float(slope) * (count - 1)
    return 0.0
