"""Prose is read once: sentences are short, and no table cell is a paragraph.

What does not meet the limits yet stands in `LISTED` with its figures. They may only fall, and a file that got better is
listed anew or taken out: `python tests/docs/test_prose.py` prints the list as it has to be.
"""

import ast
import itertools
import re
from pathlib import Path
from typing import NamedTuple

import pytest
import typer.main

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("tacdata", "label_farm", "training", "viewers", "schemas")
FOLDERS = (*ROOMS, "docs", "examples", "benchmarks", "tests")
PAGES = sorted([*ROOT.glob("*.md"), *(page for folder in FOLDERS for page in (ROOT / folder).rglob("*.md"))])
SECTION = re.compile(r"^\s*(Args|Returns|Raises|Yields|Attributes|Examples?):\s*$", re.MULTILINE)
FEWEST = 4
"""Shorter sentences are captions and do not count."""


class Figures(NamedTuple):
    """How dense some prose is."""

    median: int
    """Words of a sentence."""
    p90: int
    over: int
    """Sentences of more than 30 words [%], rounded up."""
    cells: int = 0
    """Table cells of more than 25 words."""

    def within(self, limit):
        return all(mine <= most for mine, most in zip(self, limit, strict=True))


LIMIT = Figures(median=14, p90=25, over=4, cells=0)
LISTED: dict[str, Figures] = {}
"""Pages that are longer than that, as they are now."""
LIMITS = {"docstrings": Figures(12, 19, 2), "fields and constants": Figures(11, 18, 1), "help": Figures(9, 15, 0)}
"""Of what stands in the code; to be lowered whenever it has fallen."""


def plain(text):
    """Return Markdown without code, tables, headings, pictures and the addresses of links; items are paragraphs."""
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r"```.*?```", "\n\n", text, flags=re.DOTALL)
    text = re.sub(r"<[^>]+>", " ", text)
    lines = []
    for line in text.split("\n"):
        if re.match(r"\s*(\||#|=+$|-+$|:)", line):
            lines.append("")
            continue
        if re.match(r"\s*([*-]|\d+\.)\s", line):
            lines.append("")
        lines.append(re.sub(r"^\s*([*-]|\d+\.|>)\s+", "", line))
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", "", "\n".join(lines))
    return re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)


def sentences(text):
    """Return the number of words and the text of every sentence."""
    found = []
    for paragraph in re.split(r"\n\s*\n", plain(text)):
        for sentence in re.split(r"(?<=[.!?])[\"')]*\s+(?=[A-Z`*_(\[])", " ".join(paragraph.split())):
            count = len(re.findall(r"[A-Za-z0-9_`'./-]+", sentence))
            if count >= FEWEST:
                found.append((count, sentence))
    return found


def figures(texts):
    """Return how dense texts are; None where there is no sentence and no long cell."""
    counts = sorted(count for text in texts for count, _ in sentences(text))
    rows = [line for text in texts for line in text.split("\n")]
    rows = [line for line in rows if line.startswith("|") and not re.match(r"\|[\s:|-]+$", line)]
    cells = sum(len(cell.split()) > 25 for row in rows for cell in row.strip("|").split("|"))
    if not counts:
        return Figures(0, 0, 0, cells)
    over = sum(count > 30 for count in counts)
    return Figures(counts[len(counts) // 2], counts[int(0.9 * len(counts))], -(-100 * over // len(counts)), cells)


def name(page):
    return page.relative_to(ROOT).as_posix()


def worst(texts, count=3):
    longest = sorted((sentence for text in texts for sentence in sentences(text)), reverse=True)[:count]
    return "; longest: " + " / ".join(f"{words} words: {sentence[:120]}" for words, sentence in longest)


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_pages_are_read_once(page):
    now = figures([page.read_text()])
    listed = LISTED.get(name(page))
    if listed is None:
        assert now.within(LIMIT), f"{now}, at most {LIMIT}{worst([page.read_text()])}"
        return
    assert now.within(listed), f"longer than it was: {now}, listed {listed}{worst([page.read_text()])}"
    assert not now.within(LIMIT), f"{name(page)} meets the limits: take it out of LISTED"
    assert now == listed, f"{name(page)} got better: list it as {now}"


def test_what_is_listed_is_there():
    assert set(LISTED) <= {name(page) for page in PAGES}


def in_code():
    """Return the docstrings of public modules, classes and functions, and those below fields and constants."""
    docstrings, fields = [], []
    for path in sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py")):
        if path.name.endswith("_pb2.py"):
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                text = ast.get_docstring(node) if not getattr(node, "name", "").startswith("_") else None
                docstrings += [SECTION.split(text)[0]] if text else []
            body = getattr(node, "body", None)
            if isinstance(body, list):
                fields += [below(before, after) for before, after in itertools.pairwise(body)]
    return docstrings, [text for text in fields if text]


def below(before, after):
    """Return the string on the line below an assignment."""
    if not isinstance(before, ast.Assign | ast.AnnAssign) or not isinstance(after, ast.Expr):
        return None
    value = after.value
    return value.value if isinstance(value, ast.Constant) and isinstance(value.value, str) else None


def help_texts():
    """Return what `--help` says of every verb and option."""
    from tacdata.cli import application

    waiting, found = [typer.main.get_command(application())], []
    while waiting:
        command = waiting.pop()
        waiting += getattr(command, "commands", {}).values()
        found += [command.help or "", *(getattr(parameter, "help", None) or "" for parameter in command.params)]
    return found


def texts(kind):
    if kind == "help":
        return help_texts()
    return in_code()[0 if kind == "docstrings" else 1]


@pytest.mark.parametrize("kind", LIMITS)
def test_what_stands_in_the_code_is_read_once(kind):
    found = texts(kind)
    assert figures(found).within(LIMITS[kind]), f"{figures(found)}, at most {LIMITS[kind]}{worst(found)}"


if __name__ == "__main__":
    for page in PAGES:
        if not (now := figures([page.read_text()])).within(LIMIT):
            print(f'    "{name(page)}": Figures{tuple(now)},')
    for kind in LIMITS:
        print(f'    "{kind}": {figures(texts(kind))}')
