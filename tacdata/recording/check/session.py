"""Findings that only a whole session shows: channel order, gain steps, offset steps."""

from __future__ import annotations

import numpy as np

from tacdata.recording.check.alignment import loading, reading_lag, slip
from tacdata.recording.check.channel_order import (
    Answers,
    answers,
    counts_as_press,
    gain_steps,
    misplaced,
    orders,
    silent,
    unanswered,
)
from tacdata.recording.check.figures import RecordingFigures
from tacdata.recording.check.findings import UNUSABLE, WARNING, Finding

TURNED = ("turned by 180 deg", "mirrored along x", "mirrored along y")
"""Texts for the usual wrong orders of a plug (`channel_order.orders`)."""
OFFSET = 20.0
"""Warning threshold: change of an idle reading between two recordings [times the noise]."""
OFFSET_SHARE = 0.3
"""... and its minimum share of the channel's strongest answer [1], so that slow relaxation is not reported."""


LAG_MS = 40.0
"""Delay of one recording's readings against the others' that is reported [ms of real time]."""
LAG_SHARE = 0.06
"""... and as a share of the difference in how long the way in takes [1]: the skin's own hysteresis."""
LAG_DEPTH = 0.2
"""Error of the depth by that delay that makes a recording unusable [mm]."""
FEWEST = 4
"""Recordings needed for comparing their delays or noise [count]."""
LOUDER = 3.0
"""Warning threshold: noise of a recording over that of the session's quiet ones [1]."""


def session_findings(entries: list[RecordingFigures]) -> list[Finding]:
    """Return findings on the channels, from their answers to the session's presses."""
    apart = [*_delays(entries), *_louder(entries)]
    found = answers(entries)
    if found is None:
        return apart
    if unanswered(found):
        text = "no channel answered to any press: no contact (check the registration), or the board is not the sensor's"
        return [*apart, Finding(UNUSABLE, "taxels", "", text)]
    moved = misplaced(found)
    texts = [(UNUSABLE, text) for text in _places(found, moved)]
    if quiet := [channel for channel in silent(found) if channel not in moved]:
        texts.append((UNUSABLE, f"channel {', '.join(map(str, quiet))} did not answer to presses close by"))
    names = [f.recording.episode.path.name for f in entries if counts_as_press(f)]
    for channel, (press, factor) in gain_steps(found).items():
        text = f"channel {channel} answers {factor:.2f} times as strongly from about {names[press]} on"
        texts.append((UNUSABLE, text))
    texts += [(WARNING, text) for text in _offsets(entries, found)]
    if not moved and (slipped := slip(found)):
        at, (x, y) = slipped
        words = "the tool or the skin slipped, or the registration changed"
        texts.append((UNUSABLE, f"answers lie x {x:+.1f}, y {y:+.1f} mm elsewhere from {names[at]} on: {words}"))
    return [*apart, *(Finding(severity, "taxels", "", text) for severity, text in texts)]


def _delays(entries: list[RecordingFigures]) -> list[Finding]:
    """Find the recordings whose readings are late, or early, against the motion when the others' are not."""
    known = [(entry, lag) for entry in entries if (lag := reading_lag(entry)) is not None]
    if len(known) < FEWEST:
        return []
    usual, found = float(np.median([lag for _, lag in known])), []
    duration = float(np.median([loading(entry) for entry, _ in known]))
    for entry, lag in known:
        episode = entry.recording.episode
        limit = LAG_MS * float(episode.rig.get("clock", {}).get("rate", 1.0))
        if abs(lag - usual) > limit + LAG_SHARE * abs(loading(entry) - duration):
            depth = abs(lag - usual) * 1e-3 * episode.press.speed
            text = f"they come {lag - usual:+.0f} ms later against the motion than in other recordings"
            severity = UNUSABLE if depth > LAG_DEPTH else WARNING
            found.append(Finding(severity, "taxels", episode.path.name, f"{text}: {depth:.2f} mm of depth"))
    return found


def _louder(entries: list[RecordingFigures]) -> list[Finding]:
    """Find the recordings in which all channels are noisier than in the session's quiet ones."""
    noise = [[v for v in entry.document["taxels"]["idle_noise"] if v is not None] for entry in entries]
    known = [(entry, float(np.median(values))) for entry, values in zip(entries, noise, strict=True) if values]
    if len(known) < FEWEST:
        return []
    quiet = max(float(np.percentile([value for _, value in known], 25)), 0.5)
    return [
        Finding(
            WARNING, "taxels", entry.recording.episode.path.name,
            f"its noise is {value / quiet:.0f} times that of the session's quiet recordings",
        )
        for entry, value in known if value > LOUDER * quiet
    ]  # fmt: skip


def _places(found: Answers, moved: dict[int, int]) -> list[str]:
    """Describe the channels that are wired to other taxels than the sensor file says."""
    for words, order in zip(TURNED, orders(found.taxels)[1:], strict=True):
        same = sum(int(order[k]) == j for k, j in moved.items())
        if len(moved) > 0.6 * len(order) and same > 0.9 * len(moved):
            return [f"the channels answer as if the array were {words}: plug, order of channels or registration"]
    return [
        f"channel {channel} answers like taxel {taxel}: swapped wires, or a wrong yaw in the registration"
        for channel, taxel in moved.items()
    ]


def _offsets(entries: list[RecordingFigures], found: Answers) -> list[str]:
    """Describe the channels whose idle reading steps between two recordings while others' do not."""
    idle = np.array(
        [[np.nan if v is None else v for v in f.document["taxels"]["idle_reading"]] for f in entries], float
    )
    if len(idle) < 2:
        return []
    change = np.diff(idle, axis=0)
    known = np.isfinite(change).any(axis=1)
    shared = np.zeros(len(change))
    shared[known] = np.nanmedian(change[known], axis=1)
    alone = np.nan_to_num(change - shared[:, None])
    limit = np.maximum(OFFSET * found.noise, OFFSET_SHARE * np.abs(found.response).max(axis=0))
    words = []
    for channel in np.flatnonzero((np.abs(alone) > limit).any(axis=0)).tolist():
        at = int(np.argmax(np.abs(alone[:, channel])))
        name = entries[at + 1].recording.episode.path.name
        words.append(f"the idle reading of channel {channel} steps by {alone[at, channel]:+.0f} counts before {name}")
    return words
