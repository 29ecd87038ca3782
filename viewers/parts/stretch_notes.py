"""Notes of people on intervals of a recording, as intervals of its scene."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from tacdata.dataset.notes import read_notes
from tacdata.viewers.scene.scene import Scene, Span


def with_stretch_notes(scene: Scene, root: Path, recording: Callable[[], str]) -> Scene:
    """Return a scene with the notes of its recording.

    Args:
        scene: The scene; its first reading is the notes' zero.
        root: The session or dataset.
        recording: Returns the hash of the recording's file; asked only where there are notes.

    Raises:
        FormatError: If the file of notes is damaged.
    """
    notes = read_notes(root)
    if not notes or not len(scene.taxels.time_ns):
        return scene
    digest, first = recording(), int(scene.taxels.time_ns[0])
    selection = sorted((note for note in notes if note.recording == digest), key=lambda note: note.begin)
    spans = [Span(note.text, first + round(1e9 * note.begin), first + round(1e9 * note.end)) for note in selection]
    return replace(scene, notes=tuple(spans))
