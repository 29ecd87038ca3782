"""Findings about a recording, judged by its figures: warnings, and reasons why it is unusable."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tacdata.recording.check.alignment import (
    ends_before_reports,
    loading,
    missing_ends,
    other_place,
    reading_lag,
    stood_still,
)
from tacdata.recording.check.camera_findings import camera_warnings
from tacdata.recording.check.channel_health import held_by_chance, held_frames, spikes
from tacdata.recording.check.clocks import clock_warnings
from tacdata.recording.check.figures import COUNTS, RecordingFigures
from tacdata.recording.check.idle import idle_rows
from tacdata.recording.check.imported import imported_findings, is_imported
from tacdata.recording.check.possible import impossible

WARNING, UNUSABLE = "warning", "unusable"
LOST_SHARE = 0.01
"""Share of lost frames from which a recording is unusable [1]."""
GAP_MS = 200.0
"""Time without a sample from which a recording is unusable [ms]: windows of 9 frames would bridge it unnoticed."""
RATE_SHARE = 0.02
"""Warning threshold: deviation from the nominal rate [1]."""
LATENCY_MS = 250.0
"""Warning threshold: latency of the host [ms of real time]."""
REPORT_GAP_MS = 1500.0
"""Warning threshold: time without a status report [ms of real time]."""
DEPTH_MM = (0.05, 0.2)
"""Depth uncertainty from which a warning is given, and from which a recording is unusable [mm]."""
LATE_MS = 20.0
"""Contradiction of reports and profile from which a motion came late [ms of real time]: the controller is the cause of
which then looks like a jump at rest."""
HOLD_MM = 0.05
"""Distance between reported and commanded position in the hold that makes a recording unusable [mm]."""
EXACT_MM = 0.01
"""... and from which there is a warning, besides the resolution of a report on three axes [mm]."""
LAG_MS = 150.0
"""Warning threshold: delay of the readings against the motion [ms of real time]; skins creep, so less is no proof."""
LAG_SHARE = 0.25
"""... and as a share of the way in [1]: hysteresis alone shifts the readings by some 5 %."""
PLACE_MM = 0.1
"""Distance of the guide's path from the label's that makes a recording unusable [mm]."""
HELD = 4
"""Frames in a row without change from which a board counts as held at any noise [count]."""
HELD_BY_CHANCE = 1e-4
"""... and runs of fewer frames that noise may leave in a recording, at most [count]."""
NOISE_RATIO = 5.0
"""Warning threshold: noise of a channel over the median noise [1]."""
DEAD_DEPTH = 0.3
"""Depth of a press [mm] from which a board without any answer counts as dead."""


@dataclass(frozen=True)
class Finding:
    """One warning, or one reason why a recording is unusable."""

    severity: str
    """``warning`` or ``unusable``."""
    stream: str
    """Stream or channel that it concerns."""
    file: str
    """Name of the recording; empty for the session."""
    text: str
    """Description of the finding, as a sentence."""


def findings(figures: RecordingFigures) -> list[Finding]:
    """Judge one recording."""
    if is_imported(figures.recording.episode):
        # Quantised or resting channels of a foreign sensor do not prove a fault.
        doubts = [(WARNING, stream, text) for _, stream, text in _channels(figures)]
        judgements = [*imported_findings(figures), *doubts]
    else:
        parts = (_recording, _taxels, _channels, _cnc, _cameras, _together)
        judgements = [judgement for part in parts for judgement in part(figures)]
    judgements += impossible(figures)
    name = figures.recording.episode.path.name
    return [Finding(severity, stream, name, text) for severity, stream, text in judgements]


Judgement = tuple[str, str, str]
"""Severity, stream, text."""


def _rate_of_clock(figures: RecordingFigures) -> float:
    return float(figures.recording.episode.rig.get("clock", {}).get("rate", 1.0))


def _recording(figures: RecordingFigures) -> Iterator[Judgement]:
    episode = figures.recording.episode
    if not episode.complete:
        yield UNUSABLE, "recording", "; ".join(episode.notes) or "it was broken off"
    registration = episode.rig.get("registration", {})
    if not registration.get("method") or not registration.get("date"):
        text = "the rig file does not say how and when the sensor was registered to the guide"
        yield WARNING, "registration", text
    phases = {phase.name for phase in episode.phases}
    missing = [name for name in ("rest", "approach", "press", "hold", "release") if name not in phases]
    if episode.complete and missing:
        yield UNUSABLE, "recording", f"no {', '.join(missing)} phase"


def _taxels(figures: RecordingFigures) -> Iterator[Judgement]:
    values, rate = figures.document["taxels"], _rate_of_clock(figures)
    if values["frames"] < 2:
        yield UNUSABLE, "taxels", f"{values['frames']} frames"
        return
    period, gap = 1000 / values["nominal_rate"], values["longest_gap"]
    if values["lost"]:
        share = values["lost"] / (values["frames"] + values["lost"])
        text = f"{values['lost']} frames lost ({100 * share:.1f} %), longest gap {gap:.0f} ms"
        yield UNUSABLE if share > LOST_SHARE or gap > GAP_MS else WARNING, "taxels", text
    # A counter that goes up by one across a gap: the board itself paused.
    elif gap > max(GAP_MS, 2.5 * period):
        yield UNUSABLE, "taxels", f"a gap of {gap:.0f} ms without a sample"
    if values["rate"] and abs(values["rate"] / values["nominal_rate"] - 1) > RATE_SHARE:
        yield WARNING, "taxels", f"{values['rate']:.2f} Hz, nominal {values['nominal_rate']:g} Hz"
    for text in (*_line(values["driver_counts"]), *clock_warnings(values["clock"], rate)):
        yield WARNING, "taxels", text
    if figures.recording.episode.taxels.counter.min() < 0:
        text = "the board sends no counter: lost frames cannot be seen, sample times are arrival times"
        yield WARNING, "taxels", text
    if values["latency"] / rate > LATENCY_MS:
        yield WARNING, "taxels", f"the host was up to {values['latency']:.0f} ms late in reading"
    elif (silent := _longest_silence(figures)) > LATENCY_MS * rate:
        yield WARNING, "taxels", f"the host read nothing for {silent:.0f} ms, then what had waited"


def _longest_silence(figures: RecordingFigures) -> float:
    """Return the longest time in which nothing arrived though readings were taken [ms]."""
    stream = figures.recording.episode.taxels
    longest = int(np.argmax(np.diff(stream.arrival_ns)))
    span = stream.sample_ns[longest + 1] - stream.sample_ns[longest]
    return float(stream.arrival_ns[longest + 1] - stream.arrival_ns[longest] - span) / 1e6


def _line(counts: dict) -> Iterator[str]:
    """Describe the driver's counts on the line."""
    if counts.get("corrupt", 0):
        yield f"{counts['corrupt']} damaged frames discarded"
    if counts.get("repeated", 0):
        yield f"{counts['repeated']} frames came twice and were discarded"
    if counts.get("garbage_bytes", 0):
        yield f"{counts['garbage_bytes']} bytes between the frames belong to none"
    yield from counts.get("notes", [])


def _channels(figures: RecordingFigures) -> Iterator[Judgement]:
    values, episode = figures.document["taxels"], figures.recording.episode
    if values["undefined"]:
        yield UNUSABLE, "taxels", f"channel {_list(values['undefined'])} has readings that are no numbers"
    for first, second in values["tied"]:
        yield UNUSABLE, "taxels", f"channels {first} and {second} read the same throughout: tied together"
    counts = episode.taxels.counts
    if len(counts) > 1 and (counts == counts[:1]).all() and episode.press.depth >= DEAD_DEPTH:
        yield UNUSABLE, "taxels", "no channel ever changes, not even under the press: the board is dead"
    delay = figures.document["cnc"]["contradiction"] / _rate_of_clock(figures)
    # Off its profile, the controller may have moved where it seems to stand still.
    if values["jumps"] and delay > LATE_MS:
        text = f"jumps while nothing moves are NOT ASSESSED: the controller moved up to {delay:.0f} ms off its profile"
        yield WARNING, "taxels", text
    else:
        for text in _jumps(values["jumps"], counts.shape[1], values["unit"]):
            yield UNUSABLE, "taxels", text
    if values["stuck"]:
        yield UNUSABLE, "taxels", f"channel {_list(values['stuck'])} stopped changing"
    if values["saturated"]:
        yield UNUSABLE, "taxels", f"channel {_list(values['saturated'])} ran into a limit"
    noise, response = (np.array([np.nan if v is None else v for v in values[n]]) for n in ("idle_noise", "response"))
    repeats = held_frames(counts, noise)
    idle = counts[idle_rows(episode)]
    if repeats >= HELD or (repeats > 1 and held_by_chance(counts, idle, repeats) < HELD_BY_CHANCE):
        yield WARNING, "taxels", f"the board repeats one frame: no channel changes for {repeats} frames"
    for spike in spikes(episode, noise, response):
        at = (spike.time_ns - int(episode.taxels.sample_ns[0])) * 1e-9
        size = _size(spike.size, values["unit"])
        yield WARNING, "taxels", f"channel {spike.channel} has a spike of {size} at {at:.1f} s while still"
    if np.isnan(noise).all():
        yield WARNING, "taxels", "no idle stretch to measure noise and baseline"
        return
    loud = np.flatnonzero(noise > NOISE_RATIO * max(float(np.nanmedian(noise)), 1e-9)).tolist()
    if loud:
        yield WARNING, "taxels", f"channel {_list(loud)} is over {NOISE_RATIO:g} times as noisy as the others"


def _together(figures: RecordingFigures) -> Iterator[Judgement]:
    """Judge whether readings, motion and label belong together."""
    rate = _rate_of_clock(figures)
    if words := other_place(figures, PLACE_MM):
        yield UNUSABLE, "label", words
    if still := stood_still(figures, rate):
        text = f"the controller may have stood still for {still:.0f} ms on its way in or out, and told nothing then"
        yield UNUSABLE, "cnc", text
    start_gap, end_gap = missing_ends(figures)
    # A slow board may miss two and a half periods.
    allowed = max(GAP_MS * rate, 2500 / figures.document["taxels"]["nominal_rate"])
    if start_gap > allowed:
        yield UNUSABLE, "taxels", f"they begin {start_gap:.0f} ms after the press does"
    if end_gap > allowed:
        yield UNUSABLE, "taxels", f"they end {end_gap:.0f} ms before the press does"
    elif (gap := ends_before_reports(figures)) > allowed:
        text = f"they end {gap:.0f} ms before the controller's reports: the press is whole, the board fell silent"
        yield WARNING, "taxels", text
    lag = reading_lag(figures)
    deviation = figures.document["cnc"]["hold_error"] or 0.0
    # Where the guide was not where it should be, its times cannot be judged.
    if lag is not None and deviation <= HOLD_MM and abs(lag) > max(LAG_MS * rate, LAG_SHARE * loading(figures)):
        text = f"they come {lag:+.0f} ms after the motion: measure the delay by a sync tap (record --sync-tap)"
        yield WARNING, "taxels", text


def _cnc(figures: RecordingFigures) -> Iterator[Judgement]:
    values = figures.document["cnc"]
    if not values["reports"]:
        yield UNUSABLE, "cnc", "no status report"
        return
    # GRBL may append a code to a state, as in Door:1.
    alarms = [state for state in values["states"] if state.split(":")[0] in ("Alarm", "Door")]
    if alarms:
        yield UNUSABLE, "cnc", f"the controller was in state {', '.join(alarms)}"
    if values["longest_gap"] / _rate_of_clock(figures) > REPORT_GAP_MS:
        yield WARNING, "cnc", f"no status report for {values['longest_gap']:.0f} ms"
    if values["damaged"]:
        text = f"{values['damaged']} status reports could not be read: check the controller's cable and ground"
        yield WARNING, "cnc", text
    if figures.document["complete"] and values["depth_uncertainty"] > DEPTH_MM[0]:
        text = f"the depth while pressing is uncertain by {values['depth_uncertainty']:.3f} mm"
        if values["contradiction"]:
            text += f": reports contradict the commanded profile by {values['contradiction']:.0f} ms"
        yield UNUSABLE if values["depth_uncertainty"] > DEPTH_MM[1] else WARNING, "cnc", text
    yield from hold_judgements(figures)


def hold_judgements(figures: RecordingFigures) -> list[Judgement]:
    """Judge by the reports at rest whether the guide stood where it was sent."""
    error = figures.document["cnc"]["hold_error"]
    # A distance in space: the resolution counts on three axes.
    exact = EXACT_MM + np.sqrt(3.0) * figures.recording.height_resolution
    if error is None or error <= min(exact, HOLD_MM):
        return []
    text = f"the guide stood {error:.3f} mm from the commanded position in the hold"
    if error <= HOLD_MM:
        text += f"; steps and reports explain {exact - EXACT_MM:.3f} mm"
    return [(UNUSABLE if error > HOLD_MM else WARNING, "cnc", text)]


def _cameras(figures: RecordingFigures) -> list[Judgement]:
    entries = figures.recording.episode.rig.get("cameras", {})
    doubts = camera_warnings(entries, figures.document["cameras"], _rate_of_clock(figures))
    return [(WARNING, stream, text) for stream, text in doubts]


def _jumps(entries: list[dict], channels: int, unit: str) -> list[str]:
    # So many at once have one cause, such as the supply.
    if len(entries) > channels / 2:
        first = min(jump["at"] for jump in entries)
        return [f"{len(entries)} channels jump while nothing moves, from {first:.1f} s on"]
    return [
        f"channel {jump['channel']} jumps by {_size(jump['size'], unit)} at {jump['at']:.1f} s while nothing moves"
        for jump in entries
    ]


def _size(change: float, unit: str) -> str:
    return f"{change:{'+.0f' if unit == COUNTS else '+.3g'}} {unit}"


def _list(channels: list[int]) -> str:
    return ", ".join(str(channel) for channel in channels)
