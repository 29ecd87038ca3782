"""Judges a press right after it: did the skin begin at depth zero, and did a channel answer at all?"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tacdata.errors import DeviceError
from tacdata.recording.check.figures import RecordingFigures, figures
from tacdata.recording.check.first_contact import LIMITS, first_contact
from tacdata.recording.check.idle import idle_rows
from tacdata.recording.check.possible import ANSWER, CONTACT, answer
from tacdata.recording.check.session import over_taxels
from tacdata.recording.files.reader import read_recording

REMEDY = (
    "see that the indenter sits and the board answers; find the machine's zero again (home it, or touch off) or "
    "register again, and begin a new session"
)


def require_contact(path: Path) -> None:
    """Compare the first contact of a finished press with depth zero.

    Raises:
        DeviceError: If the skin begins elsewhere, or a press over a taxel is not felt.
    """
    entry = figures(read_recording(path))
    press = entry.recording.episode.press
    contact = first_contact(entry)
    if contact is not None and contact.exceeds(LIMITS[1]):
        raise DeviceError(
            f"{path.name}: first contact was at depth {contact.depth:+.2f} +- {contact.uncertainty:.2f} mm, not at 0",
            f"at most {LIMITS[1]:g} mm",
            REMEDY,
        )
    felt = answer(entry)
    if felt is not None and felt < ANSWER and not _felt_at_all(entry) and press.depth >= CONTACT and over_taxels(entry):
        raise DeviceError(
            f"{path.name}: no channel answers to a press of {press.depth:g} mm over a taxel",
            f"a channel that changes by {ANSWER:g} times its noise",
            REMEDY,
        )


def _felt_at_all(entry: RecordingFigures) -> bool:
    """Whether a channel leaves its idle reading at any time: readings of a busy computer come late, and do come."""
    counts, idle = entry.recording.episode.taxels.counts, idle_rows(entry.recording.episode)
    if not idle.any():
        return True
    noise = np.maximum(counts[idle].std(axis=0), 0.5)
    change = np.sort(np.abs(counts - np.median(counts[idle], axis=0)), axis=0)[-5:].mean(axis=0)
    return bool((change > 2.0 * ANSWER * noise).any())
