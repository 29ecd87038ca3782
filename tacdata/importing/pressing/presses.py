"""Cuts the rows of one trial into recordings of single presses."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.mapping import Mapping, PositionEntry, TrialRule
from tacdata.importing.pressing.clock_lag import lag_doubts
from tacdata.importing.pressing.foreign_sensor import foreign_sensor
from tacdata.importing.pressing.known_values import known_numbers, label_of
from tacdata.importing.pressing.path_faults import without_faults
from tacdata.importing.pressing.press_path import PressPath, press_path
from tacdata.importing.pressing.reading_faults import reading_doubts
from tacdata.importing.pressing.schedule import ScheduledPress, read_schedule
from tacdata.importing.pressing.trials import windows
from tacdata.importing.recording_file import ImportedPress
from tacdata.importing.source_table import SourceTable, axis
from tacdata.importing.streams import ImportedStreams, Stream, read_streams
from tacdata.indenters import from_document
from tacdata.plans import Press
from tacdata.rig import Registration

DEEPEST, FARTHEST = 100.0, 1000.0
"""Largest plausible depth with an assumed unit, and with a stated one [mm]. A plan allows no more."""
NO_INDENTER = {"shape": "sphere", "radius": 2.0}
"""Stand-in for an unknown indenter."""
FEWEST = 10
"""Fewest rows of a stretch between two steps back of the time that is a recording [rows]."""
ANSWER = 5.0
"""Smallest change of readings that follow a path [their noise]."""
LEAST = 0.005
"""Smallest stroke that needs no question [mm]; tactile sensors feel some hundredths of a millimetre."""
SLOWEST = 1e-4
"""Smallest speed that a press is given [mm/s]."""


@dataclass(frozen=True)
class _Trial:
    """Values that the presses of a trial have in common."""

    mapping: Mapping
    tables: dict[str, SourceTable]
    press: dict[str, float]
    """Stated values of its presses."""
    contact: dict[str, float]
    """Machine position at which the skin is touched."""
    centre: tuple[float, float]


@dataclass(frozen=True)
class Refusal:
    """A stretch of a trial that cannot be a recording, and why. The rest of the trial is imported."""

    trial: str
    error: FormatError


def presses_of(
    mapping: Mapping,
    tables: dict[str, SourceTable],
    parts: dict[str, str],
    record: dict[str, Any],
    centre: tuple[float, float] = (0.0, 0.0),
) -> Iterator[ImportedPress | Refusal]:
    """Yield the recordings that the rows of a trial hold, and a refusal for each stretch that cannot be one.

    Args:
        mapping: The mapping.
        tables: Name under ``files`` -> rows.
        parts: {part} of the paths -> its text.
        record: The import record so far.
        centre: x and y of the array's centre [mm] where the mapping does not say them: one for all trials.

    Raises:
        FormatError: If columns, units or clocks are wrong, or there is neither position nor schedule.
    """
    if mapping.specimen:
        record = {**record, "specimen": label_of(mapping.specimen, tables, parts, "press: specimen")}
    press = known_numbers(mapping.press, tables, parts, "press")
    trial = _Trial(mapping, tables, press, known_numbers(mapping.contact, tables, parts, "contact"), centre)
    stretches = read_streams(mapping, tables, (press.get("x", 0.0), press.get("y", 0.0)))
    if len(stretches) > 1 and mapping.schedule:
        raise FormatError(
            f"a schedule, and channels whose time goes back {'; '.join(stretches[0].taxels.steps_back)}",
            "one clock for the presses of a schedule",
            "import the parts before and behind the step as files of their own",
        )
    # Recordings hold no negative times. All streams and stretches move by the same shift, so they stay aligned.
    shift = max(-min(int(s.time_ns.min(initial=0)) for streams in stretches for s in streams.all), 0)
    for number, streams in enumerate(stretches):
        label = f"{record['trial']} stretch {number}".strip() if len(stretches) > 1 else record["trial"]
        if len(stretches) > 1 and len(streams.taxels.time_ns) < FEWEST:
            note = f"stretch {number} has {len(streams.taxels.time_ns)} rows and is left out"
            yield Refusal(label, FormatError(note, f"{FEWEST} rows or more", "leave it out"))
            continue
        yield from _of_stretch(trial, streams, {**record, "trial": label, "time_shift_ns": shift})


def _of_stretch(trial: _Trial, streams: ImportedStreams, record: dict[str, Any]) -> Iterator[ImportedPress | Refusal]:
    """Yield the recordings of a stretch, and a refusal for each part that cannot be one."""
    mapping = trial.mapping
    scheduled = read_schedule(mapping.schedule, trial.tables, streams.taxels)
    if streams.position is None and not scheduled:
        raise FormatError(
            "neither a position nor a press schedule",
            "one of them: without it the presses are unknown",
            "add position or schedule to the mapping; for a sensor left alone: position: {file: ..., depth: -1}",
        )
    shift = record["time_shift_ns"]
    streams, scheduled = _shifted(streams, shift), [replace(s, start_ns=s.start_ns + shift) for s in scheduled]
    if streams.position is not None and not len(streams.position.time_ns) and not scheduled:
        error = FormatError(f"trial {record['trial']}: no position in it", "a position", "split otherwise")
        yield Refusal(record["trial"], error)
        return
    if mapping.position is None or not mapping.position.trusted:
        streams = without_faults(streams)
    place, unsaid = _registration(trial, streams)
    doubts = (*streams.doubts, *_doubts(mapping, streams, place))
    record = {**record, "set_aside": list(doubts), "notes": [*streams.notes, *doubts]}
    cuts = _cuts(mapping.trials, streams, scheduled, place)
    for number, (begin, end, planned) in enumerate(cuts):
        label = (record["trial"] + (f" #{number}" if len(cuts) > 1 else "")).strip()
        part = streams.within(begin, end)
        if planned:
            part = replace(part, position=_commanded(planned, begin, end))
        try:
            _check_rows(part, label)
            yield _imported(trial, part, place, planned, unsaid, {**record, "trial": label})
        except FormatError as error:
            yield Refusal(label, error)


def _doubts(mapping: Mapping, streams: ImportedStreams, place: Registration) -> tuple[str, ...]:
    """Return doubts that need readings and position together, as sentences."""
    taxels, position, entry = streams.taxels, streams.position, mapping.position
    if position is None or entry is None or min(len(taxels.time_ns), len(position.time_ns)) < FEWEST:
        return ()
    depth = place.to_sensor(position.values)[:, 2]
    read = [*([] if mapping.taxels.trusted else [taxels]), *(each for each in streams.measured if each.name == "force")]
    doubts = tuple(doubt for each in read for doubt in reading_doubts(each, position.time_ns, depth))
    if (entry.file, entry.clock.column) != (mapping.taxels.file, mapping.taxels.clock.column):
        doubts += lag_doubts(taxels, position)
    return doubts


def _check_rows(streams: ImportedStreams, trial: str) -> None:
    """Refuse a press without rows.

    Raises:
        FormatError: Naming the trial.
    """
    rows = len(streams.taxels.time_ns)
    if rows < 2:
        raise FormatError(
            f"{rows} rows: fewer than two rows of the channels", "two rows or more", "split the trials otherwise"
        )
    if streams.position is None or not len(streams.position.time_ns):
        raise FormatError(
            f"trial {trial or 'without a name'}: no position in it", "a position", "split the trials otherwise"
        )


def _imported(
    trial: _Trial,
    streams: ImportedStreams,
    place: Registration,
    planned: ScheduledPress | None,
    unsaid: list[str],
    record: dict[str, Any],
) -> ImportedPress:
    mapping, stand_ins = trial.mapping, [*unsaid]
    taxels, lost, restarted = _without_counter(streams)
    spans = np.diff(taxels.time_ns)
    rate = float(1e9 / np.median(spans[spans > 0])) if (spans > 0).any() else 1.0
    sensor, unknown = foreign_sensor(mapping.sensor, mapping.folder, len(taxels.names), round(rate, 3))
    position = streams.position
    if position is None:
        raise FormatError("no position", "a position", "add it to the mapping")
    tip = place.to_sensor(position.values)
    path = press_path(position.time_ns, tip)
    limit = DEEPEST if position.assumed else FARTHEST
    if abs(path.depth) > limit:
        raise FormatError(
            f"trial {record['trial'] or 'without a name'}: {path.depth:.4g} mm deep, as the mapping has it",
            f"presses of at most {limit:g} mm",
            "say the unit of the position's columns in the mapping (unit: um, m, inch), or correct contact",
        )
    for doubt in filter(None, (restarted, _path_doubt(taxels, position, tip[:, 2]), _cut_doubt(tip[:, 2]))):
        record = {**record, "set_aside": [*record["set_aside"], doubt], "notes": [*record["notes"], doubt]}
    indenter, name = from_document(mapping.indenter or NO_INDENTER, "indenter"), "unknown"
    if mapping.indenter:
        name = mapping.indenter["shape"]
    else:
        stand_ins.append("indenter: not given by the source; a sphere of 2 mm is the stand-in")
    if path.speed is None and "speed" not in trial.press:
        stand_ins.append("speed: the indenter does not move; 1 mm/s is the stand-in")
    angles = {"yaw": 0.0, "tilt_x": 0.0, "tilt_y": 0.0}
    values = {"x": path.x, "y": path.y, "depth": path.depth, "speed": path.speed or 1.0, "hold": path.hold, **angles}
    values = {key: round(value, 4) for key, value in {**values, **trial.press}.items()}
    press = Press(
        index=0,
        indenter=indenter,
        indenter_name=name,
        x=values["x"],
        y=values["y"],
        yaw=values["yaw"],
        tilt_x=values["tilt_x"],
        tilt_y=values["tilt_y"],
        depth=values["depth"],
        speed=max(values["speed"], SLOWEST),
        hold=values["hold"],
    )
    phases = planned.phases(int(taxels.time_ns[0])) if planned else path.phases
    notes = [*record["notes"], *_remarks(taxels, planned, path, lost), *stand_ins]
    registration = {
        "origin": list(place.origin),
        "yaw": place.yaw,
        "tilt": list(place.tilt),
        "method": f"import: {mapping.known_from}",
        "date": datetime.now(UTC).date().isoformat(),
    }
    record = {**record, "stand_ins": [*stand_ins, *unknown], "notes": notes}
    return ImportedPress(press, sensor, registration, taxels, position, streams.measured, phases, {}, record, lost)


def _path_doubt(taxels: Stream, position: Stream, depth: np.ndarray) -> str:
    """Return a doubt about the zero or the unit of a path that the readings follow, above the skin or hardly moved."""
    stroke = float(np.ptp(depth))
    if depth.max() > DEEPEST:
        return f"position: it reaches {depth.max():.4g} mm deep: is its unit another?"
    if stroke <= 0 or (depth.max() > 0 and stroke >= LEAST):
        return ""
    at = np.interp(taxels.time_ns, position.time_ns, depth)
    low, high = at <= at.min() + 0.1 * stroke, at >= at.max() - 0.1 * stroke
    if min(low.sum(), high.sum()) < FEWEST:
        return ""
    # No stretch at rest is known here: the usual change from row to row stands for the noise.
    noise = np.nanmedian(np.abs(np.diff(taxels.values, axis=0)), axis=0)
    change = np.abs(np.nanmedian(taxels.values[high], axis=0) - np.nanmedian(taxels.values[low], axis=0))
    if not (change > ANSWER * noise).any():
        return ""
    if stroke < LEAST:
        return f"position: it moves by {1000 * stroke:.3g} um in all, and the readings follow it: is its unit another?"
    return (
        f"position: it stays {abs(depth.max()):.4g} mm above the skin, and the readings follow it: correct its zero "
        "(contact, offset, or zero under the position) or its sign (scale: -1)"
    )


def _cut_doubt(depth: np.ndarray) -> str:
    """Return a doubt about a press of which only the way back was recorded, or only the way in."""
    stroke = float(np.ptp(depth))
    deep = depth > depth.min() + 0.5 * stroke
    ways_in = int((deep[1:] & ~deep[:-1]).sum())
    ways_back = int((deep[:-1] & ~deep[1:]).sum())
    if stroke < LEAST or depth.max() <= 0:
        return ""
    if deep[0] and not ways_in:
        return "position: it begins deep in the skin: is the way in part of another file or trial? (join: continued)"
    if deep[-1] and not ways_back:
        return "position: it ends deep in the skin: is the way back part of another file or trial? (join: continued)"
    return ""


def _remarks(taxels: Stream, planned: ScheduledPress | None, path: PressPath, lost: int) -> list[str]:
    notes = []
    missing = np.isnan(taxels.values).mean()
    if missing > 0:
        notes.append(f"{100 * missing:.1f} % of the channels' values are missing and stay so")
    if lost > 0:
        notes.append(f"{lost} frames are missing by the device's counter")
    if planned:
        notes.append("the position is the schedule's; it was not measured")
    elif not path.phases:
        notes.append("no single press in the path: no phases are marked")
    return notes


def _without_counter(streams: ImportedStreams) -> tuple[Stream, int, str]:
    """Return the channels without the counter, the frames that it misses, and a doubt about its restarts.

    A counter that falls by nearly a power of two wraps.
    """
    taxels = streams.taxels
    if not streams.counted:
        return taxels, -1, ""
    counter = taxels.values[:, -1]
    steps = np.diff(counter[np.isfinite(counter)])
    lost = int(np.maximum(steps[steps > 0] - 1, 0).sum())
    falls = -steps[steps < 0]
    # A fall by nearly a power of two is a counter that wrapped; by anything else, a device that began again.
    begun = falls[2.0 ** np.ceil(np.log2(falls + 1)) - falls > FEWEST]
    doubt = "taxels: the device's counter begins again: how many frames are missing there is not known"
    return replace(taxels, values=taxels.values[:, :-1]), lost, doubt * bool(len(begun))


def centre_of(position: PositionEntry | None, tables: dict[str, SourceTable]) -> tuple[float, float]:
    """Return the median place [mm] of a machine over whole tables, before trials are cut; 0 without such columns.

    The median of each trial would put all presses at one place.
    """
    if position is None:
        return 0.0, 0.0
    columns = [position.columns.get(name, 0.0) for name in ("x", "y")]
    x, y = (float(np.nanmedian(axis(tables[position.file], column, "mm", "position"))) for column in columns)
    return x, y


def _registration(trial: _Trial, streams: ImportedStreams) -> tuple[Registration, list[str]]:
    """Return the skin's pose in the machine's frame, and which of its values are stand-ins."""
    contact, centre, position = trial.contact, trial.centre, streams.position
    if position is None or streams.depth_given:
        return Registration((0.0, 0.0, 0.0), contact.get("yaw", 0.0)), []
    values = position.values
    origin = (contact.get("x", centre[0]), contact.get("y", centre[1]), contact.get("z", float(values[:, 2].max())))
    unsaid = []
    if "z" not in contact:
        unsaid.append("contact/z: not said by the source; depth is counted from the highest position")
    if "x" not in contact or "y" not in contact:
        unsaid.append("contact/x, y: not said by the source; the median position is taken for the array's centre")
    return Registration(origin, contact.get("yaw", 0.0)), unsaid


def _cuts(
    trials: TrialRule, streams: ImportedStreams, scheduled: list[ScheduledPress], place: Registration
) -> list[tuple[int, int, ScheduledPress | None]]:
    begin, end = int(streams.taxels.time_ns[0]), int(streams.taxels.time_ns[-1]) + 1
    if scheduled:
        knots = [press.knots[0] for press in scheduled]
        # Cut half way between two presses: both keep idle readings.
        middles = [int(a[-1] + b[0]) // 2 for a, b in pairwise(knots)]
        edges = [min(begin, int(knots[0][0])), *middles, max(end, int(knots[-1][-1]) + 1)]
        return list(zip(edges[:-1], edges[1:], scheduled, strict=True))
    position = streams.position
    depth = (position.time_ns, place.to_sensor(position.values)[:, 2]) if position else None
    return [(a, b, None) for a, b in windows(trials, streams.taxels.time_ns, depth)]


def _commanded(planned: ScheduledPress, begin_ns: int, end_ns: int) -> Stream:
    time_ns, position = planned.knots
    time_ns = np.concatenate([[min(begin_ns, time_ns[0] - 1)], time_ns, [max(end_ns, time_ns[-1] + 1)]])
    # At rest before and after the press, up to the ends of the readings: a position must exist for each of them.
    return Stream("position", time_ns, position[[0, 0, 1, 2, 3, 3]], ("x", "y", "z"), "mm", "aligned")


def _shifted(streams: ImportedStreams, shift_ns: int) -> ImportedStreams:
    if not shift_ns:
        return streams

    def moved(stream: Stream) -> Stream:
        return replace(stream, time_ns=stream.time_ns + shift_ns)

    position = moved(streams.position) if streams.position else None
    return replace(
        streams, taxels=moved(streams.taxels), position=position, measured=tuple(map(moved, streams.measured))
    )
