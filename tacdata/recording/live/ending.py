"""The last lines on the screen when a session broke off: motion, tip, data, and the next step."""

from __future__ import annotations

from pathlib import Path

from tacdata.errors import TacdataError
from tacdata.recording.files import file_names
from tacdata.recording.live.guarded_motion import GuardedMotion


def ending(motion: GuardedMotion, lost: str, data: tuple[str, ...], command: str, error: BaseException) -> str:
    """Return the lines; none repeats the error itself.

    Args:
        motion: Guide that moved.
        lost: Why the position is not known, in words; empty if it is.
        data: Files on the disk, a line each.
        command: How to go on.
        error: Error that broke the session off.
    """
    detail = error.given if isinstance(error, TacdataError) else ""
    first = "find its zero again (home it, or touch off), then " if lost else ""
    motion_lines = motion.ending
    is_reported = lost in detail or any(lost in line for line in motion_lines)
    why = "do not trust the position that the machine reports" if is_reported else lost
    position = (f"zero:   LOST: {why}",) if lost else ()
    lines = (*motion_lines, *position, *(f"data:   {line}" for line in data), f"then:   {first}{command}")
    for phrase in (f" ({detail})", f", and {detail}") if detail else ():
        lines = tuple(line.replace(phrase, "") for line in lines)
    return "\n".join(f"  {line}" for line in lines)


def on_disk(folder: Path, presses: int) -> tuple[str, ...]:
    """Describe the recordings in a session's folder, of so many ``presses``."""
    if not folder.exists():
        return ("nothing was written",)
    broken = file_names.unfinished(folder)
    lines = (f"{len(file_names.finished(folder))} of {presses} presses are complete in {folder}",)
    return (*lines, f"broken off, readable: {', '.join(path.name for path in broken[-3:])}") if broken else lines
