"""Notes on stretches of the episodes of a list."""

from tacdata.dataset.notes import Note, add_note, read_notes, remove_note
from tacdata.errors import UsageError
from tacdata.viewers.browse.episode_list import EpisodeList
from tacdata.viewers.browse.flagging import recording_of


def notes_of(listed: EpisodeList, number: int) -> list[Note]:
    """Return the notes on an episode, in the order of time.

    Raises:
        UsageError: If there is no such episode.
    """
    entry, notes = listed.numbered(number), read_notes(listed.root)
    if not notes:
        return []
    recording = recording_of(listed, entry)
    return sorted((note for note in notes if note.recording == recording), key=lambda note: (note.begin, note.end))


def note_stretch(listed: EpisodeList, number: int, begin: float, end: float, text: str) -> str:
    """Note something of a stretch [s after the first reading] of an episode; return it with the episode's name.

    Raises:
        UsageError: If there is no such episode, no stretch or no text.
        DeviceError: If the disk refuses it.
    """
    entry = listed.numbered(number)
    note = add_note(listed.root, recording_of(listed, entry), entry.file, begin, end, text)
    return f"{entry.file or number}, {note.begin:g} to {note.end:g} s: {note.text}"


def unnote_stretch(listed: EpisodeList, number: int, place: int) -> str:
    """Delete a note by its place among the episode's; return its text.

    Raises:
        UsageError: If there is none.
    """
    notes = notes_of(listed, number)
    if not 0 <= place < len(notes):
        raise UsageError(f"note {place} of episode {number}", f"one of its {len(notes)}", "look at the list again")
    remove_note(listed.root, notes[place])
    return notes[place].text
