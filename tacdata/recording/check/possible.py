"""Physical bounds: times, speeds and contact that no rig produces, and the limits of a recording."""

from __future__ import annotations

import numpy as np

from tacdata.recording.check.figures import RecordingFigures
from tacdata.recording.check.imported import is_imported
from tacdata.recording.episode import Episode
from tacdata.recording.files.reader import Recording

UNUSABLE, WARNING = "unusable", "warning"
RATES = (0.1, 100_000.0)
"""Slowest and fastest rate that a tactile sensor's recording has [Hz]."""
SPANS = (0.1, 7 * 86_400.0)
"""Shortest and longest recording of one press [s]."""
BACKWARD = 0.01
"""Share of rows that may come before the row ahead of them [1]."""
DISTINCT = 0.2
"""Share of rows that must have a time of their own [1]; coarse time stamps repeat a few times each."""
UNEVEN, LONG, RARE = 1.5, 10.0, 0.05
"""Largest ratio of the mean and the median interval between rows [1]. Intervals of so many medians are pauses, if no
larger share of all intervals is so long."""
REPEATED, VARIED = 50, 25
"""Rows in a row that repeat earlier ones, and different rows among them, from which a recording is a loop [count]."""
RATE_RATIO = 1.2
"""Largest ratio of the rate that the source states and the rate of its rows [1]."""
FASTER = 1.2
"""How much faster than commanded a guide may seem to move between two reports [1]."""
SPEED = 1000.0
"""Speed at which no indenter moves [mm/s]."""
CONTACT = 0.3
"""Depth from which a sensor must answer [mm]."""
ANSWER = 5.0
"""Minimum change of a channel between rest and contact that counts as an answer [times its noise]."""

Doubt = tuple[str, str, str]
"""Severity, stream, text."""


def impossible(figures: RecordingFigures) -> list[Doubt]:
    """Return the impossible parts of a recording, as (severity, stream, text)."""
    episode = figures.recording.episode
    times = [] if figures.document["taxels"]["lost"] else _uneven(episode.taxels.sample_ns)
    stated = _other_rate(figures.document["taxels"]["rate"], figures.document["taxels"]["nominal_rate"])
    return [
        *_times(episode.taxels.sample_ns),
        *times,
        *(stated if is_imported(episode) else []),
        *_repeats(episode.taxels.counts),
        *_motion(figures.recording),
        *_force(episode),
    ]


def _times(time_ns: np.ndarray) -> list[Doubt]:
    rows = len(time_ns)
    if rows < 2:
        return []
    steps, distinct = np.diff(time_ns), len(np.unique(time_ns))
    span = float(np.ptp(time_ns)) * 1e-9
    backward = int((steps < 0).sum())
    if backward > BACKWARD * rows:
        text = f"{backward} of {rows} rows come before the row ahead of them: their times alternate"
        return [(UNUSABLE, "taxels", text)]
    if distinct < DISTINCT * rows:
        return [(UNUSABLE, "taxels", f"{rows} rows have only {distinct} different times: they say nothing of a rate")]
    doubts: list[Doubt] = []
    if distinct < rows:
        doubts.append((WARNING, "taxels", f"{rows - distinct} of {rows} rows have the time of another row"))
    # Rows of one time count once: a coarse clock repeats times, and the sensor is no faster for it.
    rate = (distinct - 1) / span
    if not RATES[0] <= rate <= RATES[1]:
        text = f"{rate:.3g} rows a second: the times are in another unit than the file says"
        doubts.append((UNUSABLE, "taxels", text))
    elif not SPANS[0] <= span <= SPANS[1]:
        doubts.append((UNUSABLE, "taxels", f"it lasts {span:.3g} s: no press does"))
    return doubts


def _uneven(time_ns: np.ndarray) -> list[Doubt]:
    """Judge the mean interval by the median one: they differ where rows of two recordings alternate, and in bursts."""
    steps = np.diff(time_ns) * 1e-6
    if len(steps) < REPEATED or (usual := float(np.median(steps))) <= 0 or len(np.unique(time_ns)) < len(time_ns):
        return []
    pauses = steps > LONG * usual
    mean = float(steps[~pauses].mean() if pauses.mean() <= RARE else steps.mean())
    if max(mean / usual, usual / max(mean, 1e-300)) <= UNEVEN:
        return []
    text = (
        f"rows come every {usual:.4g} ms in the median and every {mean:.4g} ms in the mean: they come in bursts, or "
        "rows of two recordings alternate; their times are not those of the measurement"
    )
    return [(UNUSABLE, "taxels", text)]


def _other_rate(rate: float | None, stated: float) -> list[Doubt]:
    """Compare the rate of the rows with the one that the source states [Hz]."""
    if not rate or max(rate / stated, stated / rate) <= RATE_RATIO:
        return []
    text = (
        f"{rate:.4g} rows a second, and the source states {stated:.4g}, in its data or its sensor file: the unit of "
        "the times or the rate is wrong"
    )
    return [(UNUSABLE, "taxels", text)]


def _repeats(counts: np.ndarray) -> list[Doubt]:
    """Judge rows that repeat earlier ones, value for value: noise never does, a file played in a loop does."""
    readings = np.nan_to_num(np.ascontiguousarray(counts, dtype=float))
    if len(readings) < 2 * REPEATED:
        return []
    _, kind = np.unique(readings, axis=0, return_inverse=True)
    kind = kind.ravel().astype(np.uint64)
    # A key of the rows in each window; equal windows have equal keys.
    factors = np.random.default_rng(0).integers(1, 2**63, REPEATED, dtype=np.uint64)
    windows = len(kind) - REPEATED + 1
    keys = np.zeros(windows, dtype=np.uint64)
    for place, factor in enumerate(factors):
        keys += kind[place : place + windows] * factor
    _, first, group = np.unique(keys, return_index=True, return_inverse=True)
    # Windows that overlap do not count: a resting signal equals itself one row later.
    for later in np.flatnonzero(first[group] <= np.arange(windows) - REPEATED).tolist():
        earlier = int(first[group[later]])
        # A coarse signal at rest repeats itself by rounding alone.
        if len(np.unique(kind[later : later + REPEATED])) < VARIED:
            continue
        same = kind[later:] == kind[earlier : earlier + len(kind) - later]
        rows = len(same) if same.all() else int(np.argmin(same))
        text = (
            f"rows {later + 1} to {later + rows} repeat rows {earlier + 1} to {earlier + rows}, value for value: the "
            "source was played in a loop, or it was computed and not measured"
        )
        return [(UNUSABLE, "taxels", text)]
    return []


def _motion(recording: Recording) -> list[Doubt]:
    """Judge speeds: between reports where there are commands, along the path where there are none."""
    episode, stream = recording.episode, recording.episode.cnc
    if recording.moves and len(stream.sample_ns) > 1:
        # Sample times are the middle of query and answer, so two positions are at most this far apart in time.
        half = stream.arrival_ns - stream.sample_ns
        longest = (stream.arrival_ns[1:] - (stream.sample_ns[:-1] - half[:-1])) * 1e-9
        way = np.linalg.norm(np.diff(stream.position, axis=0), axis=1)
        commanded = max(move.profile.peak for move in recording.moves)
        fastest = float((np.maximum(way - recording.height_resolution, 0.0) / longest).max())
        if episode.complete and fastest > FASTER * commanded:
            text = f"the guide moved at {fastest:.1f} mm/s or more, where at most {commanded:.1f} mm/s was commanded"
            return [(UNUSABLE, "cnc", text)]
    elif len(episode.tip_ns) > 1:
        seconds = np.diff(episode.tip_ns) * 1e-9
        way = np.linalg.norm(np.diff(episode.tip, axis=0), axis=1)
        # The 99th percentile, as one jump between two strokes is no speed.
        usual = float(np.percentile(way[seconds > 0] / seconds[seconds > 0], 99)) if (seconds > 0).any() else 0.0
        if usual > SPEED:
            text = f"the position moves at {usual:.3g} mm/s: its times or its lengths are in another unit"
            return [(UNUSABLE, "position", text)]
    return []


def _force(episode: Episode) -> list[Doubt]:
    """Judge a measured force that does not notice the press."""
    deepest = float(episode.tip[:, 2].max()) if len(episode.tip) else 0.0
    if deepest < CONTACT:
        return []
    return [
        (UNUSABLE, stream.name, f"the force never changes, though the indenter goes {deepest:.2f} mm deep")
        for stream in episode.measured
        if stream.unit == "N" and len(stream.values) > 1 and not np.nan_to_num(np.ptp(stream.values, axis=0)).any()
    ]


def answer(figures: RecordingFigures) -> float | None:
    """Return the strongest channel's change from rest to contact [times its noise]; None where it is unknown."""
    episode = figures.recording.episode
    if not len(episode.tip_ns) or not len(episode.taxels.sample_ns):
        return None
    depth = episode.tip_at(episode.taxels.sample_ns)[:, 2]
    noise = np.array([np.nan if v is None else v for v in figures.document["taxels"]["idle_noise"]], float)
    away, inside = depth <= 0, depth > max(0.8 * float(depth.max()), CONTACT)
    if not away.any() or not inside.any():
        return None
    counts = episode.taxels.counts
    channels = np.isfinite(noise) & np.isfinite(counts[inside]).any(axis=0) & np.isfinite(counts[away]).any(axis=0)
    if not channels.any():
        return None
    # Medians of many readings: noise of single ones would count as an answer.
    change = np.abs(np.nanmedian(counts[inside][:, channels], axis=0) - np.nanmedian(counts[away][:, channels], axis=0))
    return float((change / np.maximum(noise[channels], _quantum(counts[:, channels]))).max())


def _quantum(counts: np.ndarray) -> np.ndarray:
    """Return a bound of the noise, relative to each channel's own range, shape (channels,)."""
    return np.maximum(1e-9 * np.nan_to_num(np.nanmax(counts, axis=0) - np.nanmin(counts, axis=0)), 1e-300)
