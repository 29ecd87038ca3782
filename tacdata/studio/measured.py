"""Measured files of another rig as an entry, for the import wizard."""

from collections import Counter
from pathlib import Path

from tacdata.studio.entry import LabEntry, command, local_minute

SECTION = "Measured files"
ENDINGS = (".csv", ".tsv", ".xlsx", ".mat", ".npz", ".npy", ".parquet", ".arrow", ".db3", ".bag", ".zarr")
"""Endings of measured files, none of which the other verbs write beside sessions."""


def measured_sources(root: Path, files: list[Path], occupied: set[Path]) -> list[Path]:
    """Return what is to be imported: folders of measured files alone, and files that lie beside other entries.

    Args:
        root: The lab's folder.
        files: Files near it.
        occupied: Folders of other entries; files inside them are theirs.
    """
    measured = [path for path in files if path.suffix in ENDINGS and not occupied & set(path.parents)]
    mixed = {parent for folder in occupied for parent in folder.parents}
    tops = {path: root / path.relative_to(root).parts[0] for path in measured}
    return sorted({path if top in mixed else top for path, top in tops.items()})


def measured_entry(root: Path, source: Path) -> LabEntry:
    """Return the entry of a folder of measured files, or of one file."""
    name, mapping = source.relative_to(root), root / f"{source.stem}-mapping.yaml"
    files = [path for path in source.rglob("*") if path.suffix in ENDINGS] if source.is_dir() else [source]
    kinds = Counter(path.suffix for path in files)
    facts = [f"{count} {ending}" for ending, count in kinds.most_common()]
    steps = [command("import", name, "--web")]
    if mapping.is_file():
        bring = ("import", name, "--mapping", mapping.relative_to(root), "--out", f"{source.stem}-session")
        steps.insert(0, command(*bring))
    changed = max(path.stat().st_mtime for path in files)
    words = "a mapping is there" if mapping.is_file() else "columns are to be assigned"
    return LabEntry(
        SECTION,
        name.as_posix(),
        words,
        facts=tuple(facts),
        date=local_minute(changed),
        commands=tuple(steps),
        order=changed,
    )
