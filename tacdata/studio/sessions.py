"""A session as an entry: check's sentence, presses, labels, state of its recording."""

from datetime import datetime
from pathlib import Path

from tacdata import documents
from tacdata.labels import file_names as label_names
from tacdata.recording.live.recorder_process import recorder_of
from tacdata.recording.session import FILE
from tacdata.studio.entry import LabEntry, command, local_minute, pages_in
from tacdata.studio.recording_state import RecordingState, recording_state

SECTION, RUNNING = "Sessions", "Recording now"


def session_entry(root: Path, folder: Path) -> LabEntry:
    """Return the entry of a session. Raises as `documents.read`."""
    document = documents.read(folder / FILE, "session")
    name = folder.relative_to(root)
    state = recording_state(folder, len(document["plan"]["presses"]))
    labels = len(label_names.present(label_names.folder(folder)))
    sentence, tone = _live(state) if state.running else checked(folder, state.done)
    faults = [f"latest fault: {state.fault.removeprefix('broken off: ')}"] if state.fault else []
    if document.get("position_lost"):
        faults.append("the machine's position was lost")
    if state.cut is not None:
        faults.append(f"{state.cut.name} has no end")
    return LabEntry(
        RUNNING if state.running else SECTION,
        name.as_posix(),
        sentence,
        tone,
        (f"{state.done} of {state.wanted} presses", f"{labels} labelled" if labels else "not labelled"),
        tuple(faults),
        local_minute(datetime.fromisoformat(document["started"]).timestamp()),
        _next(name, state, labels, tone),
        pages_in(root, folder),
        state.running,
        can_stop=state.running and recorder_of(folder) is not None,
        share=state.done / state.wanted if state.wanted else None,
        order=state.newest,
    )


def checked(folder: Path, finished: int) -> tuple[str, str]:
    """Return check's sentence on a session and its tone.

    Args:
        folder: The session.
        finished: Its recordings [count].
    """
    if not (folder / "check.json").is_file():
        return "not checked", ""
    report = documents.content_of(folder / "check.json", "check")
    # The figures of each recording are not shown; to validate those of hundreds takes a tenth of a second.
    documents.check({**report, "episodes": []}, "check", str(folder / "check.json"))
    reasons = [finding for finding in report["findings"] if finding["severity"] == "unusable"]
    named = reasons or report["findings"]
    words = "usable" if report["usable"] else "NOT usable as it is"
    if named:
        first = named[0]
        where = f" ({first['file']})" if first["file"] else ""
        words += f"; {first['stream']}: {first['text']}{where}"
        words += f"; {len(named) - 1} more" if len(named) > 1 else ""
    else:
        words += ", nothing to remark"
    unchecked = finished - len(report["episodes"])
    words += f"; {unchecked} recorded since" if unchecked > 0 and not reasons else ""
    return words, "good" if report["usable"] else "bad"


def _live(state: RecordingState) -> tuple[str, str]:
    """Return the sentence on a recording that runs."""
    writes = f"{state.current.name} is being written" if state.current else "between two presses"
    if state.seconds_left is None:
        return f"{writes}; time left unknown before the second press", "good"
    minutes = round(state.seconds_left / 60)
    duration = f"{minutes} min" if minutes else "less than a minute"
    return f"{writes}; {duration} left, until {local_minute(state.newest + state.seconds_left)[11:]}", "good"


def _next(name: Path, state: RecordingState, labels: int, tone: str) -> tuple[str, ...]:
    if state.current is not None:
        return (command("view", name / state.current.name, "--web"),)
    look = command("browse", name, "--web")
    if state.running or not state.done:
        return (look,) if state.done else ()
    if state.cut is not None:
        return command("recover", name / state.cut.name), look
    if not tone:
        return command("check", name), look
    if tone == "bad":
        return look, command("check", name)
    if labels < state.done:
        return command("label", name), look
    return command("pack", name, "--out", f"{name}-dataset"), look
