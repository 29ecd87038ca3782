"""Recordings from measured files of another rig."""

from collections.abc import Callable
from pathlib import Path

from tacdata.importing.imported_session import Imported, import_session
from tacdata.paths import StrPath


def import_files(
    source: StrPath, mapping: StrPath, out: StrPath, progress: Callable[[str], None] = lambda line: None
) -> Imported:
    """Import measured files as a session, by a mapping of columns and units.

    Args:
        source: A folder or file: CSV, Excel, JSON, NumPy, MATLAB, Parquet.
        mapping: Mapping file (`schemas/import_mapping.schema.json`).
        out: Session folder to create.
        progress: Called with a line for each recording.

    Returns:
        The result: the folder, the number of recordings, notes, and the trials that were refused.

    Raises:
        UsageError: If ``out`` exists, or a file is missing.
        FormatError: If nothing could be imported, with the first reason.

    Example:
        >>> import tacdata as td
        >>> imported = td.import_files("source", "examples/import_foreign.yaml", "from another rig")
        >>> len(td.read_session(imported.folder))
        3
    """
    return import_session(Path(source), Path(mapping), Path(out), progress=progress)
