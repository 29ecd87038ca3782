"""Specimen and place of a press, as columns or the paths of files state them."""

import re

from tacdata.importing.mapping import KnownValue
from tacdata.importing.proposing.file_kinds import INSIDE, listed
from tacdata.importing.proposing.question import Question
from tacdata.importing.proposing.source_kind import SourceKind

SPECIMEN = re.compile(r"(?:specimen|spec|sample|material|coupon|probe)[-_ ]?$", re.IGNORECASE)
"""Text in a path before the number or the name of a specimen."""
PLACE = re.compile(r"(?<![A-Za-z])([xyXY])[-_=]?$")
"""Text in a path before a place."""
MATERIAL = re.compile(
    r"ecoflex|dragon|pdms|sylgard|silicon|rubber|latex|vhb|tpu|foam|gel|agilus|ninja|elast|neopren|solaris|smooth",
    re.IGNORECASE,
)
"""Words of folders that name materials of soft sensors."""


def specimen_of(kind: SourceKind) -> tuple[KnownValue | None, tuple[Question, ...]]:
    """Return the specimen's column or part of the path, and questions about it."""
    for name in kind.roles.get("specimen", []):
        if len({str(value) for value in kind.table.columns[name].tolist() if value is not None}) > 1:
            return KnownValue(file=kind.alias, column=name), ()
    if part := next((f"part{k}" for k, text in enumerate(_texts(kind)) if SPECIMEN.search(text)), None):
        return KnownValue(part), ()
    questions: tuple[Question, ...] = ()
    for number, words in kind.found.words.items():
        if 2 * sum(bool(MATERIAL.search(word)) for word in words) >= len(words):
            text = f"the folders {listed(words)} are taken for specimens"
            return KnownValue(f"part{number}"), (*questions, Question(text, "specimen", word=f"part{number}"))
        remedy = f"Then write press: {{specimen: {{part: part{number}}}}}"
        text = f"are the folders {listed(words)} specimens? {remedy}"
        questions += (Question(text, "specimen", word=f"part{number}"),)
    return None, questions


def place_in_path(kind: SourceKind) -> dict[str, KnownValue]:
    """Return the parts of a path that are x and y, as in "x2.0_y-1.5"."""
    matches = {k: PLACE.search(text) for k, text in enumerate(_texts(kind))}
    return {match[1].lower(): KnownValue(f"part{k}") for k, match in matches.items() if match}


def _texts(kind: SourceKind) -> list[str]:
    """Return the texts of a path before each of its parts that differ; a single file has none."""
    outer, _, inside = kind.kind.partition(INSIDE)
    return outer.split("#")[:-1] if kind.found.count > 1 or "#" in inside else []
