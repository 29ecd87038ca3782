"""A source on its way to a mapping: proposal, choices, the mapping's file, the session."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
import yaml

from tacdata import documents
from tacdata.documents import write_text
from tacdata.errors import SolveError, UsageError
from tacdata.importing.expression import with_derived
from tacdata.importing.mapping import FileEntry, Mapping
from tacdata.importing.proposing.description import described
from tacdata.importing.proposing.proposal import proposed_mapping
from tacdata.importing.proposing.question import Question
from tacdata.importing.proposing.source_kind import SourceKind
from tacdata.importing.source_table import SourceTable
from tacdata.pipeline.check import check
from tacdata.pipeline.import_files import import_files
from tacdata.pipeline.judge import judge
from tacdata.studio.entry import command
from tacdata.studio.wizard.alternatives import alternatives
from tacdata.studio.wizard.choices import ROLES, UNITS, Choices
from tacdata.studio.wizard.chosen_mapping import choices_of, with_choices
from tacdata.studio.wizard.outcome import outcome
from tacdata.studio.wizard.source_preview import file_preview
from tacdata.studio.wizard.table_memory import TableMemory


@dataclass(frozen=True)
class Wizard:
    """What the page shows and does."""

    source: Path
    base: Mapping
    """The proposal, or the mapping that a person goes on with."""
    kinds: tuple[SourceKind, ...]
    files: dict[str, FileEntry]
    """Every file that may be used, by its name in the mapping."""
    questions: tuple[Question, ...]
    target: Path
    """The mapping's file, where a person names no other."""
    session: Path
    """The session, likewise."""
    memory: TableMemory = field(default_factory=TableMemory)

    @classmethod
    def of(cls, source: Path, target: Path, session: Path, mapping: Path | None = None) -> Self:
        """Return the wizard of a source.

        Args:
            source: The files.
            target: Where the mapping is to be written.
            session: Where the session is to be made.
            mapping: A mapping to go on with; None: one is proposed.

        Raises:
            UsageError: If nothing in the source can be read.
            FormatError: If the mapping has a fault.
        """
        proposal = proposed_mapping(source, described(source)[0])
        base, files, questions = proposal.mapping, proposal.files, proposal.open
        if mapping is not None:
            base = Mapping.from_document(documents.read(mapping, "import_mapping"), mapping.parent)
            files, questions = {**files, **base.files}, ()
        return cls(source, base, proposal.kinds, files, questions, target, session)

    @property
    def tables(self) -> dict[str, SourceTable]:
        """Every file's columns, with derived ones."""
        entries = {**self.files, **self.base.files}
        return {kind.alias: with_derived(kind.table, entries[kind.alias].derived, "derived") for kind in self.kinds}

    def contents(self) -> dict[str, Any]:
        """Return the files, the choices, and the open questions with their answers."""
        return {
            "source": str(self.source),
            "files": [file_preview(kind, self.base) for kind in self.kinds],
            "choices": asdict(choices_of(self.base, self.tables)),
            "questions": [
                {"text": question.text, "answers": [asdict(each) for each in alternatives(question, self.base)]}
                for question in self.questions
            ],
            "roles": ROLES,
            "units": UNITS,
            "target": str(self.target),
            "session": str(self.session),
        }

    def mapping(self, choices: Choices) -> Mapping:
        """Return the mapping of some choices. Raises as `with_choices`."""
        return with_choices(self.base, self.files, self.tables, choices)

    def tried(self, choices: Choices) -> dict[str, Any]:
        """Return the mapping of some choices, as text, and the presses that it gives. Raises as `with_choices`."""
        mapping = self.mapping(choices)
        return {"text": _text(mapping), **outcome(self.source, mapping, self.memory)}

    def written(self, choices: Choices, file: str, replace: bool) -> dict[str, Any]:
        """Write the mapping of some choices.

        Args:
            choices: The choices.
            file: The mapping's file, from the working directory on.
            replace: Whether a file there may be replaced.

        Returns:
            The file and the command that imports by it; or, where it exists and may not be replaced, the question.

        Raises:
            UsageError: If the file is no YAML file, or its folder does not exist.
        """
        path, text = Path(file), _text(self.mapping(choices))
        if path.suffix not in (".yaml", ".yml") or not path.parent.is_dir() or path.is_dir():
            raise UsageError(
                f"{file} as the mapping's file", "a .yaml file in a folder that exists", "correct the name"
            )
        if path.exists() and not replace:
            return {"question": f"{path} exists. Replace it?"}
        write_text(path, text)
        return {"file": str(path), "command": self.command(path)}

    def command(self, mapping: Path, session: str = "") -> str:
        """Return the command that imports by a mapping."""
        return command("import", self.source, "--mapping", mapping, "--out", session or self.session)

    def imported(self, file: str, session: str) -> dict[str, Any]:
        """Import by a mapping's file and check the session. Raises as `tacdata.import_files`."""
        session_import = import_files(self.source, file, session)
        report = check(session_import.folder)
        return {
            "recordings": session_import.recordings,
            "refused": list(session_import.refused),
            "notes": list(session_import.notes),
            "usable": report.usable,
            "check": report.text,
            "commands": [
                self.command(Path(file), session),
                command("check", session),
                command("browse", session, "--web"),
                command("discrepancy", session, "--out", f"{session}-verdict"),
            ],
        }

    def judged(self, session: str) -> dict[str, Any]:
        """Find the effect that a response fitted to the session lacks.

        Raises:
            UsageError, FormatError: As `tacdata.judge`.
            SolveError: If the search finds no numbers, as for readings without noise.
        """
        try:
            verdict = judge(session, f"{session}-verdict")
        except (np.linalg.LinAlgError, FloatingPointError) as error:
            raise SolveError(
                f"no verdict on {session}: {error}",
                "measured readings, with their noise",
                "look at the presses with tacdata browse: are they measured, and do they differ?",
            ) from error
        return {"text": verdict.text, "folder": str(verdict.folder), "page": str(verdict.folder / "verdict.html")}


def _text(mapping: Mapping) -> str:
    return yaml.safe_dump(mapping.document, sort_keys=False, allow_unicode=True)
