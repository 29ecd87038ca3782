"""Whether a recording or session is fit to be labelled."""

from pathlib import Path

from tacdata.paths import StrPath
from tacdata.recording.check.report import Report
from tacdata.recording.check.report import check as check_recordings


def check(path: StrPath) -> Report:
    """Check every stream of a recording or session for gaps, noise, stuck channels and missing tags.

    Args:
        path: A session folder or a recording (.mcap).

    Returns:
        The report: `usable`, `text`, `document`.

    Raises:
        UsageError: If there is no recording.
        FormatError: If one is damaged.

    Example:
        >>> import tacdata as td
        >>> td.check("session").usable
        True
    """
    return check_recordings(Path(path))
