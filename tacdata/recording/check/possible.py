"""Bounds on what can be: times, speeds and contact that no rig produces, and what a recording cannot tell."""

from __future__ import annotations

import numpy as np

from tacdata.recording.check.figures import RecordingFigures
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
    """Return what cannot be in a recording, as (severity, stream, text)."""
    episode = figures.recording.episode
    return [*_times(episode.taxels.sample_ns), *_motion(figures.recording), *_force(episode)]


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
    found: list[Doubt] = []
    if distinct < rows:
        found.append((WARNING, "taxels", f"{rows - distinct} of {rows} rows have the time of another row"))
    rate = (distinct - 1) / span
    if not RATES[0] <= rate <= RATES[1]:
        text = f"{rate:.3g} rows a second: the times are in another unit than the file says"
        found.append((UNUSABLE, "taxels", text))
    elif not SPANS[0] <= span <= SPANS[1]:
        found.append((UNUSABLE, "taxels", f"it lasts {span:.3g} s: no press does"))
    return found


def _motion(recording: Recording) -> list[Doubt]:
    """Judge speeds: between reports where there are commands, along the path where there are none."""
    episode, stream = recording.episode, recording.episode.cnc
    if recording.moves and len(stream.sample_ns) > 1:
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
    """Return the strongest channel's change from rest to contact [times its noise]; None where it cannot be told."""
    episode = figures.recording.episode
    if not len(episode.tip_ns) or not len(episode.taxels.sample_ns):
        return None
    depth = episode.tip_at(episode.taxels.sample_ns)[:, 2]
    noise = np.array([np.nan if v is None else v for v in figures.document["taxels"]["idle_noise"]], float)
    away, inside = depth <= 0, depth > max(0.8 * float(depth.max()), CONTACT)
    if not away.any() or not inside.any():
        return None
    counts = episode.taxels.counts
    known = np.isfinite(noise) & np.isfinite(counts[inside]).any(axis=0) & np.isfinite(counts[away]).any(axis=0)
    if not known.any():
        return None
    change = np.abs(np.nanmedian(counts[inside][:, known], axis=0) - np.nanmedian(counts[away][:, known], axis=0))
    return float((change / np.maximum(noise[known], 1e-9)).max())
