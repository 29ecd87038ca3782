"""A verdict of `tacdata discrepancy`."""

from pathlib import Path

from tacdata.viewers.kinds.kind import Kind, refuse
from tacdata.viewers.scene.request import Asked
from tacdata.viewers.scene.scene import Scene

FILE, RESIDUALS = "verdict.json", "residuals.parquet"


class VerdictKind(Kind):
    """A folder with a verdict, or the verdict itself."""

    ORDER, NOUN = 10, "a verdict"

    def claims(self, path: Path) -> bool:
        """A folder with a verdict in it, or a file of that name."""
        return (path / FILE).is_file() or (path.is_file() and path.name == FILE)

    def scene(self, path: Path, options: Asked) -> Scene:
        """Return it as text and bars, with readings and model before and after."""
        from tacdata import documents
        from tacdata.discrepancy.verdict.residual_table import read
        from tacdata.viewers.parts.residual_curves import residual_curves
        from tacdata.viewers.scenes.verdict import verdict_scene

        refuse(options, "a verdict")
        file = path if path.is_file() else path / FILE
        picture = file.with_suffix(".png")
        document = documents.read(file, "verdict")
        lies = file.parent / RESIDUALS
        curves = residual_curves(read(lies)) if lies.is_file() else ()
        return verdict_scene(file.resolve().parent.name, document, picture if picture.is_file() else None, curves)
