"""Quantities of a unit from one session alone: noise, zero, drift, loop, repeatability."""

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from tacdata import provenance
from tacdata.dataset.frames import check_pair, recording_hash
from tacdata.errors import FormatError, UsageError
from tacdata.health.estimate import Spread, UncertainValue, mean
from tacdata.health.response import PressResponse, press_response, unusable
from tacdata.labels import file_names, read_label
from tacdata.paths import StrPath
from tacdata.recording.check.channel_health import in_phase
from tacdata.recording.check.figures import RecordingFigures, figures
from tacdata.recording.check.findings import Finding
from tacdata.recording.check.session import depth_findings
from tacdata.recording.files.reader import read_recording
from tacdata.recording.session import Session, read_session
from tacdata.sensor import Sensor

BATCHES = 6
"""Parts into which a rest is cut, whose means tell the error of its mean: neighbouring readings correlate [count]."""
WHITE = 2 / 3
"""Efficiency of a variance from neighbouring differences [1] (von Neumann)."""
STRONG = 0.3
"""Share of a press's strongest response from which a channel counts for its strength [1]: weak ones tell of creep."""
MINUTE_NS = 60e9


@dataclass(frozen=True)
class Visit:
    """One session as measured."""

    session: Session
    started: str
    """Date and time, as the session's document states it."""
    entries: tuple[RecordingFigures, ...]
    """Figures of the recordings that are used, in the plan's order."""
    responses: tuple[PressResponse, ...]
    """Responses of the channels, in the same order."""
    predicted: tuple[PressResponse, ...]
    """Predictions of labels, in the same order; empty unless every one has a label with readings."""
    left_out: tuple[tuple[str, str], ...]
    """Recordings that are not used, and why."""
    labels: dict[str, str]
    """Name of each label that is used -> the hash of its file."""
    label_remark: str = ""
    """Why its labels are not used, in words; "" if it has none or all are used."""

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.session.folder.resolve().name

    @property
    def sensor(self) -> Sensor:
        """The sensor as the session describes it."""
        return self.session.sensor

    @property
    def unit(self) -> str:
        """Unit of the readings."""
        return self.entries[0].document["taxels"]["unit"]

    @property
    def depth_findings(self) -> list[Finding]:
        """Findings of `tacdata check` on where its presses went in depth."""
        return depth_findings(list(self.entries))

    @property
    def noise(self) -> dict[int, Spread]:
        """Noise of each channel without contact [counts], over all rests."""
        spreads = [
            np.array([np.nan if v is None else v for v in e.document["taxels"]["idle_noise"]], float)
            for e in self.entries
        ]
        frames = np.array([len(in_phase(e.recording.episode, "rest")) for e in self.entries], float)
        weight = np.isfinite(spreads) * frames[:, None]
        freedom = np.maximum(WHITE * (weight.sum(axis=0) - len(frames)), 1.0)
        variance = (np.nan_to_num(np.square(spreads)) * weight).sum(axis=0) / np.maximum(weight.sum(axis=0), 1.0)
        return {k: Spread(float(np.sqrt(v)), float(f)) for k, (v, f) in enumerate(zip(variance, freedom, strict=True))}

    @property
    def zero(self) -> dict[int, UncertainValue]:
        """Reading of each channel at rest before the first press [counts]."""
        readings = in_phase(self.entries[0].recording.episode, "rest")
        # Means of a few stretches: neighbouring readings are not independent.
        parts = np.array([part.mean(axis=0) for part in np.array_split(readings, min(BATCHES, len(readings)))])
        return {k: mean(parts[:, k]) for k in range(readings.shape[1])}

    @property
    def drift(self) -> dict[int, UncertainValue]:
        """Slope of each channel's reading at rest over the visit [counts/min]."""
        idle = np.array(
            [[np.nan if v is None else v for v in e.document["taxels"]["idle_reading"]] for e in self.entries], float
        )
        minutes = np.array([p.start_ns - self.responses[0].start_ns for p in self.responses]) / MINUTE_NS
        return {k: _slope(minutes, idle[:, k]) for k in range(idle.shape[1])}

    @property
    def loop(self) -> UncertainValue:
        """Area between the way in and the way out, over depth times response [1]."""
        return mean(np.array([press.loop for press in self.responses]))

    @property
    def repeatability(self) -> Spread | None:
        """Relative standard deviation of the response to one press repeated [1]; None without a repeat."""
        groups: dict[Any, list[np.ndarray]] = defaultdict(list)
        for press in self.responses:
            groups[press.key].append(np.abs(press.hold))
        repeats = [np.array(group) for group in groups.values() if len(group) > 1]
        strong = [group[:, group.mean(axis=0) > STRONG * group.mean(axis=0).max()].sum(axis=1) for group in repeats]
        # In logarithms the spread is relative, whatever the strength of the press.
        repeated = [np.log(group) for group in strong if len(group) and group.min() > 0]
        freedom = sum(len(group) - 1 for group in repeated)
        if not freedom:
            return None
        return Spread(float(np.sqrt(sum(np.var(g) * len(g) for g in repeated) / freedom)), float(freedom))


def _slope(time: np.ndarray, values: np.ndarray) -> UncertainValue:
    valid = np.isfinite(values)
    if valid.sum() < 3 or not np.ptp(time[valid]):
        return UncertainValue(float("nan"), float("nan"), 1.0)
    fit: Any = stats.linregress(time[valid], values[valid])
    return UncertainValue(float(fit.slope), float(fit.stderr), float(valid.sum() - 2))


def read_visit(folder: StrPath) -> Visit:
    """Read a session; recordings that say nothing are named with the reason.

    Raises:
        UsageError: If it is no session, or none of its recordings can be used.
        FormatError: If its document is damaged.
    """
    folder = Path(folder)
    session = read_session(folder)
    entries, left_out = [], [(path.name, "it was interrupted") for path in session.unfinished]
    for path in session.episodes:
        try:
            entry = figures(read_recording(path))
            reason = unusable(entry)
        except FormatError as error:
            reason = error.given
        if reason:
            left_out.append((path.name, reason))
        else:
            entries.append(entry)
    if not entries:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in left_out[:3]) or "it holds none"
        raise UsageError(
            f"{folder}: no recording shows the state of the unit ({reasons})",
            "complete presses with rest, way in and hold",
            "record the plan that `tacdata plan health` writes",
        )
    entries.sort(key=lambda entry: entry.recording.episode.number)
    responses = tuple(press_response(entry.recording.episode) for entry in entries)
    predicted, labels, remark = _predicted(session, entries)
    started = session.document["started"]
    return Visit(session, started, tuple(entries), responses, predicted, tuple(left_out), labels, remark)


def _predicted(
    session: Session, entries: list[RecordingFigures]
) -> tuple[tuple[PressResponse, ...], dict[str, str], str]:
    """Return the labels' predictions for each recording, which labels, and why they are not used if they are not."""
    present = file_names.present(file_names.folder(session.folder))
    if not present:
        return (), {}, ""
    predictions, labels = [], {}
    for entry in entries:
        episode = entry.recording.episode
        path = present.get(episode.number)
        if path is None:
            return (), {}, f"{episode.path.name} has no label: gains relative to the model need one for each; label it"
        try:
            label = read_label(path)
            check_pair(episode, label, {"recording": recording_hash(episode)})
        except FormatError as error:
            return (), {}, f"its labels are not used: {error.given}"
        if label.taxel_counts is None:
            return (), {}, "its labels predict no readings: the sensor file describes no transduction"
        predictions.append(press_response(episode, label.taxel_counts.astype(float)))
        labels[path.name] = provenance.file_hash(path)
    return tuple(predictions), labels, ""
