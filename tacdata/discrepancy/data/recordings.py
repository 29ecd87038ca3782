"""Recordings (MCAP) become a course."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from os import PathLike
from pathlib import Path

import numpy as np

from tacdata.chain import Course, Tool
from tacdata.chain.rows import Rows, rows_of
from tacdata.discrepancy.data.channels import in_source, readings, usable, without_codes
from tacdata.discrepancy.data.path_noise import resolved, without_dropouts, without_noise
from tacdata.discrepancy.data.specimens import specimens
from tacdata.discrepancy.data.strokes import strokes
from tacdata.discrepancy.data.tip_observation import Views, second_views
from tacdata.errors import FormatError, UsageError
from tacdata.paths import StrPath
from tacdata.recording import Episode, read_session
from tacdata.recording.files.reader import Recording, read_recording
from tacdata.recording.session import FILE

SAME_PLACE = 0.15
"""Presses no farther apart count as one place [mm]."""
FEW_ROWS = 8
"""A stroke with fewer readings is left out."""
UNKNOWN = "unknown"
"""Name that an import gives to an indenter without one."""
HELD = 1.0
"""Gaps of a measured quantity up to so long are bridged by a straight line [s]."""
LONG_PAUSE = 36000.0
"""Sessions farther apart are laid end to end as if so far apart [s]."""


@dataclass(frozen=True)
class _Stroke:
    name: str
    session: int
    recording: int
    begin: float
    rows: Rows
    tool: Tool
    place: np.ndarray
    specimen: str
    """Name of the pressed specimen in the source; empty where it has none."""


def course_of(paths: StrPath | Iterable[StrPath]) -> Course:
    """Read recordings, in the order of their time.

    Args:
        paths: Recordings or folders of sessions, one or several.

    Raises:
        UsageError: If there is none, or a path is neither.
        FormatError: If they do not have the same channels, or hold no readings.
    """
    paths = [Path(path) for path in ([paths] if isinstance(paths, str | PathLike) else paths)]
    sessions = [[(number, read_recording(file)) for file in recordings_in(path)] for number, path in enumerate(paths)]
    sessions = [[(n, r) for n, r in session if len(r.episode.taxels.sample_ns) > 1] for session in sessions]
    # By time, whatever the order of the arguments: memory follows the clock.
    numbered = _by_time([entry for session in sessions for entry in _by_time(session)])
    numbered_episodes = [(number, r.episode) for number, r in numbered]
    notes: list[str] = []
    if not numbered_episodes:
        raise UsageError(
            f"no readings in {', '.join(map(str, paths))}", "recordings with taxel readings", "record some"
        )
    notes += _of_one_sensor([e for _, e in numbered_episodes])
    counts = {e.taxels.counts.shape[1] for _, e in numbered_episodes}
    if len(counts) > 1:
        raise FormatError(
            f"recordings of {', '.join(map(str, sorted(counts)))} channels",
            "the same channels throughout",
            "judge sensors one at a time",
        )
    recordings, odd = without_codes([r for _, r in numbered])
    numbered_episodes = [(number, r.episode) for (number, _), r in zip(numbered, recordings, strict=True)]
    columns, limits, left_out = usable([readings(r) for r in recordings])
    notes += in_source(recordings, min(counts)) + odd + left_out + _dropouts([e for _, e in numbered_episodes])
    names = sorted({m.name for _, e in numbered_episodes for m in e.measured})
    force, temperature = _named(names, "force", "load", "weight"), _named(names, "temp")
    views: dict[int, Views] = {}
    for number in sorted({n for n, _ in numbered_episodes}):
        members = [k for k, (n, _) in enumerate(numbered_episodes) if n == number]
        views |= {members[k]: v for k, v in second_views([numbered_episodes[k][1] for k in members]).items()}
    parts: list[_Stroke] = []
    for k, (number, episode) in enumerate(numbered_episodes):
        parts += _strokes_of(episode, (number, k), columns, force, temperature, views.get(k), bool(views))
    if not parts:
        raise FormatError("no stretch with enough readings", f"{FEW_ROWS} or more readings a press", "record again")
    if len(parts) > len(numbered_episodes):
        subject = "one recording holds" if len(numbered_episodes) == 1 else f"{len(numbered_episodes)} recordings hold"
        notes.append(f"{subject} {len(parts)} strokes; each counts as an episode")
    if any(e.tags for _, e in numbered_episodes) and not views:
        notes.append("the tag was seen too seldom to check the guide: keep it in view during the presses")
    course = _joined(
        parts, (columns, limits), numbered_episodes[0][1], (bool(force), bool(temperature), bool(views)), notes
    )
    return replace(course, effort=_effort([e for _, e in numbered_episodes]))


def _by_time(numbered: list[tuple[int, Recording]]) -> list[tuple[int, Recording]]:
    """Return recordings in the order of time; as they are if two overlap, since each then has a clock of its own."""
    ordered = sorted(numbered, key=lambda item: int(item[1].episode.taxels.sample_ns.min()))
    spans = [(int(r.episode.taxels.sample_ns.min()), int(r.episode.taxels.sample_ns.max())) for _, r in ordered]
    return ordered if all(a[1] <= b[0] for a, b in pairwise(spans)) else numbered


def _effort(episodes: list[Episode]) -> bool | None:
    """Return whether channels are an effort of the drive; None where the source says neither.

    Raises:
        FormatError: If recordings differ.
    """
    kinds = sorted({e.rig.get("imported", {}).get("channels_are", "not stated") for e in episodes})
    if len(kinds) > 1:
        raise FormatError(
            f"recordings whose channels are: {', '.join(kinds)}",
            "the same throughout",
            "state taxels: {channels_are: ...} in each mapping, and import again",
        )
    return {"effort": True, "response": False}.get(kinds[0])


def _of_one_sensor(episodes: list[Episode]) -> list[str]:
    """Return in words whether recordings name several sensors.

    Raises:
        FormatError: If they are of several kinds.
    """
    names = sorted({e.sensor.name for e in episodes})
    if len(names) < 2:
        return []
    kinds = {(t.columns, t.rows, t.pitch_x, t.pitch_y) for t in (e.sensor.taxels for e in episodes)}
    if len(kinds) > 1:
        raise FormatError(
            f"recordings of sensors of several kinds: {', '.join(names)}",
            "one sensor in one verdict",
            "judge them one at a time",
        )
    return [f"recordings name {len(names)} sensors ({', '.join(names[:4])}): judge them apart, unless they are one"]


def _dropouts(episodes: list[Episode]) -> list[str]:
    """Return in words how many positions were set aside."""
    lost = [without_dropouts(e.tip_ns, e.tip)[1] for e in episodes if len(e.tip_ns)]
    if not any(lost):
        return []
    return [f"position: {sum(lost)} values in {np.count_nonzero(lost)} recordings jump there and back: set aside"]


def recordings_in(path: Path) -> list[Path]:
    """Return the recordings of a path: itself, or those in the folder.

    Raises:
        UsageError: If it is neither.
    """
    if path.is_dir():
        if not (path / FILE).is_file():
            loose = sorted(path.glob("*.mcap"))
            if loose:
                return loose
        return list(read_session(path).episodes)
    if not path.is_file():
        raise UsageError(f"no file or folder {path}", "a recording (.mcap) or a session's folder", "check the path")
    return [path]


def _named(names: list[str], *words: str) -> str:
    return next((name for word in words for name in names if word in name), "")


def _measured(episode: Episode, name: str, time_ns: np.ndarray) -> np.ndarray:
    """Return a measured quantity at the readings' times, NaN where it is too far away."""
    stream = next((m for m in episode.measured if m.name == name), None)
    if stream is None or len(stream.sample_ns) < 2:
        return np.full(len(time_ns), np.nan)
    values = stream.values
    # Of a force sensor's axes the normal one, else the one that moves most.
    column = next(
        (k for k, n in enumerate(stream.names) if n.lower().endswith("z")), int(np.argmax(np.nanstd(values, 0)))
    )
    good = np.isfinite(values[:, column])
    if good.sum() < 2:
        return np.full(len(time_ns), np.nan)
    at, value = stream.sample_ns[good], values[good, column]
    result = np.interp(time_ns, at, value)
    upper = np.clip(np.searchsorted(at, time_ns), 1, len(at) - 1)
    far = np.minimum(np.abs(time_ns - at[upper - 1]), np.abs(time_ns - at[upper])) > HELD * 1e9
    result[far] = np.nan
    return result


def _strokes_of(
    episode: Episode,
    of: tuple[int, int],
    channels: np.ndarray,
    force: str,
    temperature: str,
    views: Views | None,
    tag: bool,
) -> list[_Stroke]:
    time_ns = episode.taxels.sample_ns
    order = np.argsort(time_ns, kind="stable")
    time_ns = time_ns[order]
    columns = [episode.taxels.counts[order][:, channels]]
    columns += [_measured(episode, name, time_ns)[:, None] for name in (force, temperature) if name]
    if tag:
        columns.append(np.full((len(time_ns), 3), np.nan) if views is None else views.at(time_ns))
    values = np.column_stack(columns)
    # Of two readings at one time the second is dropped: rates and interpolation need times that increase.
    good = np.isfinite(columns[0]).all(axis=1) & np.concatenate([[True], np.diff(time_ns) > 0])
    time_ns, values = time_ns[good], values[good]
    if len(time_ns) < FEW_ROWS or len(episode.tip_ns) < 2:
        return []
    tool = _tool(episode)
    result, specimen = [], str(episode.rig.get("imported", {}).get("specimen", ""))
    tip, _ = without_noise(episode.tip_ns, without_dropouts(episode.tip_ns, episode.tip)[0])
    is_resolved = resolved(episode.tip_ns, tip[:, 2], time_ns)
    spans = _to_the_end(strokes(episode.tip_ns, tip[:, 2]), tip[:, 2], time_ns)
    for number, (first, last) in enumerate(spans):
        rows = is_resolved & (time_ns >= first) & (time_ns < last)
        if rows.sum() < FEW_ROWS:
            continue
        origin = time_ns[0]
        path_time = (episode.tip_ns - origin) * 1e-9
        laid = rows_of((time_ns[rows] - origin) * 1e-9, values[rows], path_time, tip, len(channels))
        # The place of a press is where it is deepest: a path may come from aside.
        deepest = laid.tip[np.argmax(laid.tip[:, 2])]
        name = episode.path.stem + (f" stroke {number}" if len(spans) > 1 else "")
        result.append(_Stroke(name, *of, float(origin) * 1e-9, laid, tool, deepest[:2], specimen))
    return result


def _to_the_end(spans: list[tuple[int, int]], depth: np.ndarray, time_ns: np.ndarray) -> list[tuple[int, int]]:
    """Return spans with the readings before the tip began to move and after it came to rest, off the skin."""
    away = depth <= max(0.0, float(depth.min()) + 0.05 * float(np.ptp(depth)))
    if away[0]:
        spans = [(min(spans[0][0], int(time_ns[0])), spans[0][1]), *spans[1:]]
    if away[-1]:
        spans = [*spans[:-1], (spans[-1][0], max(spans[-1][1], int(time_ns[-1]) + 1))]
    return spans


def _tool(episode: Episode) -> Tool:
    """Return the indenter; a stand-in for one that nobody named has neither shape nor radius."""
    name, solid = episode.press.indenter_name, episode.press.indenter
    if name == UNKNOWN:
        return Tool(name, UNKNOWN, np.nan)  # one object: equal to itself
    return Tool(name, solid.shape, float(getattr(solid, "radius", np.nan)))


def _joined(
    parts: list[_Stroke],
    usable: tuple[np.ndarray, np.ndarray],
    example: Episode,
    extra: tuple[bool, bool, bool],
    notes: list[str],
) -> Course:
    (channel_numbers, (lowest, highest)), (force, temperature, tag) = usable, extra
    tools = tuple(dict.fromkeys(p.tool for p in parts))
    clock, last = [], None
    restarts = np.zeros(len(parts), dtype=bool)
    for k, part in enumerate(parts):
        begin = part.begin + part.rows.time[0]
        # Clocks of imported recordings may begin at zero. One that seems to begin in an earlier one is laid behind it.
        restarts[k] = last is not None and begin < last[0]
        if last is not None and not 0 <= begin - last[0] < LONG_PAUSE:
            begin = last[0] + (1.0 if restarts[k] else LONG_PAUSE)
        shift = begin - part.rows.time[0] if last is None else last[1] + (begin - last[0]) - part.rows.time[0]
        clock.append(part.rows.time + shift)
        last = part.begin + part.rows.time[-1], float(clock[-1][-1])
    count = [len(p.rows.time) for p in parts]
    episode = np.repeat(np.arange(len(parts)), count)
    values = np.concatenate([p.rows.values for p in parts])
    channels = len(channel_numbers)
    centers = example.sensor.taxels.centers
    numbers = {s: k for k, s in enumerate(sorted({p.session for p in parts}))}
    time, read = np.concatenate(clock), values[:, :channels]
    clipped = (read <= lowest) | (read >= highest)
    site, remarks = _sites(parts, channels)
    recording = np.unique([p.recording for p in parts], return_inverse=True)[1]
    return Course(
        time=time - time[0],
        episode=episode,
        tip=np.concatenate([p.rows.tip for p in parts]),
        tool=np.array([tools.index(p.tool) for p in parts])[episode],
        readings=read,
        averaged=np.concatenate([p.rows.averaged for p in parts]),
        session=np.array([numbers[p.session] for p in parts]),
        site=site,
        tools=tools,
        names=tuple(p.name for p in parts),
        centers=centers[channel_numbers] if len(centers) > int(channel_numbers.max()) else None,
        force=values[:, channels] if force else None,
        temperature=_filled(values[:, channels + force]) if temperature else None,
        notes=(*notes, *remarks, *_restarted(restarts)),
        tag=values[:, channels + force + temperature :] if tag else None,
        recording=recording if recording.max() + 1 < len(parts) else None,
        numbers=tuple(int(k) for k in channel_numbers),
        clipped=clipped if clipped.any() else None,
        specimens=tuple(p.specimen for p in parts) if any(p.specimen for p in parts) else (),
        restarts=restarts if restarts.any() else None,
    )


def _restarted(restarts: np.ndarray) -> list[str]:
    """Return in words how many presses begin on a clock of their own."""
    if not restarts.any():
        return []
    return [f"{restarts.sum()} presses have clocks of their own: the pause before each is unknown, and taken as long"]


def _sites(parts: list[_Stroke], channels: int) -> tuple[np.ndarray, list[str]]:
    """Return a number for each press that presses of one place and one specimen share, and a remark on it."""
    place, named = places(np.array([p.place for p in parts])), [p.specimen for p in parts]
    if not any(named):
        return specimens([p.rows for p in parts], place, channels)
    numbers = {name: k for k, name in enumerate(dict.fromkeys(named))}
    pairs = np.column_stack([place, [numbers[name] for name in named]])
    site = np.unique(pairs, axis=0, return_inverse=True)[1].reshape(-1)
    return site, [f"{len(numbers)} specimens by the source: each has a curve of its own"] if len(numbers) > 1 else []


def _filled(values: np.ndarray) -> np.ndarray:
    good = np.flatnonzero(np.isfinite(values))
    return np.interp(np.arange(len(values)), good, values[good])


def places(at: np.ndarray) -> np.ndarray:
    """Return the number of the place of each press: those within `SAME_PLACE` of a place's first belong to it."""
    centres: list[np.ndarray] = []
    result = np.zeros(len(at), dtype=np.int64)
    for k, place in enumerate(at):
        near = [n for n, centre in enumerate(centres) if np.linalg.norm(place - centre) < SAME_PLACE]
        if near:
            result[k] = near[0]
        else:
            result[k] = len(centres)
            centres.append(place)
    return result
