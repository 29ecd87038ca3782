"""What only a session as a whole tells of its channels, in words."""

from __future__ import annotations

import numpy as np

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
"""Words for the orders in which a plug is wrongly connected (`channel_map.orders`)."""
OFFSET = 20.0
"""Change of an idle reading from one recording to the next that is worth a word [times the noise]."""
OFFSET_SHARE = 0.3
"""... and at least so much of the channel's strongest answer [1]: what relaxes slowly is less."""


def session_findings(entries: list[RecordingFigures]) -> list[Finding]:
    """Judge the channels of a session by how they answered to its presses."""
    found = answers(entries)
    if found is None:
        return []
    if unanswered(found):
        text = "no channel answered to any press: no contact (check the registration), or the board is not the sensor's"
        return [Finding(UNUSABLE, "taxels", "", text)]
    moved = misplaced(found)
    texts = [(UNUSABLE, text) for text in _places(found, moved)]
    if quiet := [channel for channel in silent(found) if channel not in moved]:
        texts.append((UNUSABLE, f"channel {', '.join(map(str, quiet))} did not answer to presses close by"))
    names = [f.recording.episode.path.name for f in entries if counts_as_press(f)]
    for channel, (press, factor) in gain_steps(found).items():
        text = f"channel {channel} answers {factor:.2f} times as strongly from about {names[press]} on"
        texts.append((UNUSABLE, text))
    texts += [(WARNING, text) for text in _offsets(entries, found)]
    return [Finding(severity, "taxels", "", text) for severity, text in texts]


def _places(found: Answers, moved: dict[int, int]) -> list[str]:
    """Return in words which channels are wired to other taxels than the sensor file says."""
    for words, order in zip(TURNED, orders(found.taxels)[1:], strict=True):
        same = sum(int(order[k]) == j for k, j in moved.items())
        if len(moved) > 0.6 * len(order) and same > 0.9 * len(moved):
            return [f"the channels answer as if the array were {words}: plug, order of channels or registration"]
    return [
        f"channel {channel} answers like taxel {taxel}: swapped wires, or a wrong yaw in the registration"
        for channel, taxel in moved.items()
    ]


def _offsets(entries: list[RecordingFigures], found: Answers) -> list[str]:
    """Return in words which channels' idle readings step from one recording to the next, and others' do not."""
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
