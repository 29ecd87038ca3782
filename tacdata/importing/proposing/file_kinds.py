"""Kinds of files: paths that differ by a number, its sign, or a word are one kind."""

import re
from itertools import takewhile
from pathlib import PurePath

NUMBER = re.compile(r"\d+(?:[.,]\d+)?")
"""A number in a file's name: "run_0.2" and "run_1" are two runs of one kind."""
SIGNED, PLACED = re.compile(r"[-+]#"), re.compile(r"(?<![A-Za-z])([xyzXYZ])[-+]#")
PART = "#"
"""Replaces the parts that differ."""
INSIDE = "::"
"""Between a file's path and the table inside it."""


def kinds_of(paths: list[PurePath]) -> list[str]:
    """Return the paths with # in place of numbers. A sign is part of the number where others have another, or none."""
    kinds = [numberless(path.with_suffix("").as_posix()) + path.suffix for path in paths]  # the 3 of .db3 stays
    kinds = [PLACED.sub(rf"\1{PART}", kind) for kind in kinds]  # the minus of x-2 is no hyphen
    spellings: dict[str, set[str]] = {}
    for kind in kinds:
        spellings.setdefault(SIGNED.sub(PART, kind), set()).add(kind)
    return [bare if len(spellings[bare := SIGNED.sub(PART, kind)]) > 1 else kind for kind in kinds]


def numberless(text: str) -> str:
    """Return a text with # in place of its numbers."""
    return NUMBER.sub(PART, text)


def merged(kinds: list[str]) -> str | None:
    """Return one kind for several, with # for words that differ; None if they are at other depths."""
    outer, inner = zip(*(kind.partition(INSIDE)[::2] for kind in kinds), strict=True)
    paths = [PurePath(path) for path in outer]
    if len({len(path.parts) for path in paths}) > 1 or len({path.suffix for path in paths}) > 1:
        return None
    steps = [_one(list(names)) for names in zip(*(path.parts for path in paths), strict=True)]
    path_pattern = "/".join(steps)
    if all(inner):
        path_pattern += INSIDE + _one(list(inner))
    return path_pattern


def _one(names: list[str]) -> str:
    """Return the common beginning and end of names, cut at a sign between words, with # for the rest."""
    if len(set(names)) == 1:
        return names[0]
    begin = re.sub(r"[^-_ .]*$", "", _common(names))
    tails = [name[len(begin) :] for name in names]
    end = re.sub(r"^[^-_ .]*", "", _common([name[::-1] for name in tails])[::-1])
    while any(len(name) <= len(end) for name in tails):
        end = re.sub(r"^.[^-_ .]*", "", end)
    return f"{begin}{PART}{end}"


def _common(names: list[str]) -> str:
    return "".join(letters[0] for letters in takewhile(lambda signs: len(set(signs)) == 1, zip(*names, strict=False)))


def pattern(kind: str, first: int = 0) -> tuple[str, int]:
    """Return a kind as a path of a mapping with {part0}, {part1}, ..., and the number of the next part."""
    while PART in kind:
        kind, first = kind.replace(PART, f"{{part{first}}}", 1), first + 1
    return kind, first


def listed(words: list[str]) -> str:
    """Return words as a list in a sentence: a, b and c."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
