"""Result of `tacdata revise` on a verdict."""

from pathlib import Path

from tacdata.viewers.kinds.kind import Kind, refuse
from tacdata.viewers.scene.request import Asked
from tacdata.viewers.scene.scene import Scene

FILE, TABLE, CURVES = "revision.json", "gap.md", "gap.rrd"


class RevisionKind(Kind):
    """The folder of a revision."""

    ORDER, NOUN = 11, "a revision"

    def claims(self, path: Path) -> bool:
        """A folder with a revision in it."""
        return (path / FILE).is_file()

    def scene(self, path: Path, options: Asked) -> Scene:
        """Return the gap before and after, with the readings of telling episodes."""
        from tacdata import documents
        from tacdata.viewers.rerun.gap_curves import read_gap_curves
        from tacdata.viewers.scenes.verdict import revision_scene

        refuse(options, "a revision")
        document = documents.read(path / FILE, "revision")
        table = (path / TABLE).read_text() if (path / TABLE).is_file() else "No gap was computed."
        curves = read_gap_curves(path / CURVES) if (path / CURVES).is_file() else ()
        return revision_scene(path.resolve().name, document, table, curves)
