"""Which physical effect a model of a sensor lacks."""

import tempfile
from collections.abc import Callable, Iterable
from os import PathLike
from pathlib import Path

from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.run import run
from tacdata.discrepancy.verdict_folder import VerdictFolder, read_verdict
from tacdata.paths import StrPath


def judge(
    sessions: StrPath | Iterable[StrPath],
    out: StrPath | None = None,
    *,
    spec: StrPath | None = None,
    stop_after: str = "decide",
    progress: Callable[[str], None] = lambda words: None,
) -> VerdictFolder:
    """Find where recordings and a model disagree, and name the missing effect, or state why it cannot be named.

    Args:
        sessions: Recordings (.mcap) or session folders, one or several.
        out: Folder to create; None keeps the verdict only as long as this process runs.
        spec: Model spec; None fits a response to the recordings.
        stop_after: Last step: "gate", "locate", "fit" or "decide".
        progress: Called with a line for each step.

    Raises:
        UsageError: If ``out`` exists, or there is nothing to read.
        FormatError: If recordings and spec do not fit together.
    """
    paths = [sessions] if isinstance(sessions, str | PathLike) else list(sessions)
    temporary = None if out else tempfile.TemporaryDirectory(prefix="tacdata-verdict-")
    folder = Path(out) if out else Path(temporary.name if temporary else "") / "verdict"
    run([Path(path) for path in paths], read_spec(Path(spec) if spec else None), folder, progress, stop_after)
    return read_verdict(folder, temporary)
