"""Model specs: the response and the effects on top of it, as a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents, provenance, schemas
from tacdata.chain import Course, Response
from tacdata.chain.table_response import TableResponse
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import NUISANCE
from tacdata.effects import Placed, load
from tacdata.errors import FormatError
from tacdata.paths import StrPath


@dataclass(frozen=True)
class Spec:
    """A model of a sensor."""

    document: dict[str, Any]
    """As in the file (`schemas/model_spec.schema.json`)."""
    folder: Path
    """Folder that names of files in it are relative to."""

    @property
    def content_hash(self) -> str:
        """Hash of the document."""
        return provenance.content_hash(self.document)

    @property
    def nuisance(self) -> dict[str, float]:
        """Effect -> how well calibration knows it."""
        return dict(self.document.get("nuisance", NUISANCE))

    def effects(self) -> tuple[Placed, ...]:
        """Return the effects that the model has.

        Raises:
            UsageError: If one is not known.
            FormatError: If its values are not its parameters'.
        """
        placed = []
        for entry in self.document["effects"]:
            effect = load(entry["effect"])
            names = {p.name for p in effect.parameters}
            if set(entry["values"]) != names:
                raise FormatError(
                    f"model spec: {effect.name} with {', '.join(entry['values']) or 'no values'}",
                    ", ".join(sorted(names)),
                    "correct values",
                )
            placed.append(Placed(effect, {name: np.array(value, float) for name, value in entry["values"].items()}))
        return tuple(placed)

    def response(self, course: Course) -> Response:
        """Return the response for a course: fitted to it, or a table with the course's own idle readings.

        Raises:
            FormatError: If the table does not fit the course.
        """
        entry = self.document["response"]
        if entry["kind"] == "fitted":
            return FittedResponse(course)
        if entry["kind"] == "recordings":
            raise FormatError(
                "model spec: response of kind recordings, a healthy machine's sessions",
                "fitted or table",
                "compare with them by `tacdata discrepancy SESSION --spec SPEC --out DIR`",
            )
        table = TableResponse.read(self.folder / entry.get("file", ""))
        if len(table.gain) != course.channels:
            raise FormatError(
                f"a response table of {len(table.gain)} channels, recordings of {course.channels}",
                "as many",
                "take the table of this sensor, or response: {kind: fitted}",
            )
        names = {name: k for k, name in enumerate(table.tools)}
        missing = [tool.name for tool in course.tools if tool.name not in names]
        if missing:
            raise FormatError(
                f"indenter {missing[0]!r} is not in the response table",
                ", ".join(table.tools),
                "solve it too, or leave its recordings out",
            )
        table = table.with_tools([names[tool.name] for tool in course.tools])
        reduced = course.reduced
        quiet = reduced.tip[:, 2] <= 0
        return table.idling_at(np.median(reduced.readings[quiet], axis=0)) if quiet.any() else table

    def with_effects(self, placed: list[Placed], errors: list[dict[str, float]], evidence: str) -> dict[str, Any]:
        """Return the document of the next version."""
        entries = [
            {
                "effect": member.effect.name,
                "stage": member.stage,
                "values": {name: np.asarray(value).tolist() for name, value in member.values.items()},
                "error": {name: float(value) for name, value in error.items()},
                "evidence": evidence,
            }
            for member, error in zip(placed, errors, strict=True)
        ]
        return {**self.document, "parent": self.content_hash, "effects": [*self.document["effects"], *entries]}


def read_spec(path: StrPath | None) -> Spec:
    """Read a spec; without a path, a response fitted to the recordings and no effect.

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is not one.

    Example:
        >>> from tacdata.discrepancy.model.spec import read_spec
        >>> spec = read_spec(None)
        >>> spec.document["response"]
        {'kind': 'fitted'}
        >>> spec.effects()
        ()
    """
    path = None if path is None else Path(path)
    if path is None:
        document = {
            "version": schemas.version("model_spec"),
            "name": "without memory",
            "parent": None,
            "response": {"kind": "fitted"},
            "effects": [],
        }
        return Spec(document, Path())
    return Spec(documents.read(path, "model_spec"), path.parent)
