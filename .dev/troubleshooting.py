"""Write docs/reference/troubleshooting.md from the error messages in the source: what is said, allowed, to be done.

    .venv/bin/python .dev/troubleshooting.py           # writes the page
    .venv/bin/python .dev/troubleshooting.py --check   # only says whether it is current

Every construction of an error class of `tacdata.errors`, or of a class derived from one, is an entry. So is every call
of a function with the same three parameters, and every triple of a file that uses the type `Words` (`tacdata.wire`).
What is filled in when it happens stands as …; an entry whose message is nothing else is left out.
"""

from __future__ import annotations

import ast
import itertools
import re
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reference" / "troubleshooting.md"
ROOMS = ("tacdata", "label_farm", "training", "viewers", "schemas")
FILLED = "…"
PARTS = ("given", "allowed", "remedy")
BASE = "TacdataError"
MOST_VARIANTS = 4
"""Messages that one construction may stand for, by words chosen when it happens."""
WORDS, TRIPLE = "Words", "tuple[str, str, str]"
"""Types of the three parts, where they are no error yet."""
LISTED, SAID = "as listed in the message", "as described in the message"
"""Parts that are made when the error happens."""
MOST_WORDS = 24
"""Words of a part; more are cut with …."""
HEAD = """# Troubleshooting

Every error of tacdata has three parts: the given value, the allowed ones, and the remedy. Search this page for a few
words of your message. Where the message names a file, a value or a name of yours, the page shows `…`. The
[exit code](exit_codes.md) names the kind of error.

The page is generated from the source: `.venv/bin/python .dev/troubleshooting.py`.
"""


@dataclass(frozen=True, order=True)
class Entry:
    """One message that a person may meet."""

    room: str
    given: str
    allowed: str
    remedy: str


def main(arguments: list[str]) -> int:
    """Write the page, or say whether it is current."""
    text = page(entries())
    if "--check" in arguments:
        current = PAGE.exists() and PAGE.read_text() == text
        print("current" if current else f"{PAGE.relative_to(ROOT)} is not current: run {Path(__file__).name}")
        return 0 if current else 1
    PAGE.write_text(text)
    print(f"{PAGE.relative_to(ROOT)}: {text.count(chr(10) + '| ')} rows")
    return 0


def entries() -> list[Entry]:
    """Return every message, sorted by room and text."""
    trees = {path: ast.parse(path.read_text()) for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))}
    errors = error_classes(trees.values())
    found = {
        Entry(room_of(path), *parts)
        for path, tree in trees.items()
        for expressions, known in constructions(tree, errors)
        for parts in messages(expressions, known)
    }
    return sorted(found, key=lambda entry: (entry.room, sort_key(entry.given), entry))


def error_classes(trees) -> set[str]:
    """Return the names of `TacdataError` and of all classes below it."""
    bases = {
        node.name: {ast.unparse(base).rsplit(".", 1)[-1] for base in node.bases}
        for tree in trees
        for node in tree.body
        if isinstance(node, ast.ClassDef)
    }
    found = {BASE}
    while more := {name for name, above in bases.items() if above & found} - found:
        found |= more
    return found


def constructions(tree: ast.Module, errors: set[str]) -> list[tuple[list[ast.expr], dict[str, ast.expr]]]:
    """Return the three parts of every error of a file, each with what names stood for before it."""
    within = {child: node for node in ast.walk(tree) for child in ast.iter_child_nodes(node)}
    functions = [node for node in within if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    makers = errors | {f.name for f in functions if tuple(a.arg for a in f.args.args)[-len(PARTS) :] == PARTS}
    tuples = any(isinstance(node, ast.Name) and node.id == WORDS for node in within)
    given = {scope: assignments(scope) for scope in [tree, *functions]}
    found = []
    for node in within:
        if not isinstance(node, ast.Call | ast.Tuple):
            continue
        scopes = outward(node, within)
        triple = tuples or any(f.returns is not None and ast.unparse(f.returns) == TRIPLE for f in scopes[1:])
        called = isinstance(node, ast.Call) and name_of(node.func) in makers
        if called or (triple and isinstance(node, ast.Tuple) and len(node.elts) == len(PARTS)):
            known = {name: value for scope in scopes for at, name, value in given[scope] if at < node.lineno}
            found.append((parts_of(node), known))
    return found


def name_of(function: ast.expr) -> str:
    """Return the last part of a called name."""
    return getattr(function, "attr", getattr(function, "id", ""))


def outward(node: ast.AST, within: dict[ast.AST, ast.AST]) -> list[ast.AST]:
    """Return the file and the functions that a node stands in, the outermost first."""
    found = []
    while node in within:
        node = within[node]
        if isinstance(node, ast.Module | ast.FunctionDef | ast.AsyncFunctionDef):
            found.insert(0, node)
    return found


def assignments(scope: ast.AST) -> list[tuple[int, str, ast.expr]]:
    """Return what a function, or the top of a file, gives names to, with the line from which on; in their order."""
    top = isinstance(scope, ast.Module)
    nodes = [node for node in (scope.body if top else ast.walk(scope)) if isinstance(node, ast.Assign)]
    return [
        (0 if top else node.lineno, target.id, node.value)
        for node in sorted(nodes, key=lambda node: node.lineno)
        for target in node.targets
        if isinstance(target, ast.Name)
    ]


def parts_of(node: ast.expr) -> list[ast.expr]:
    """Return the three parts of an error; none where they come from elsewhere."""
    if isinstance(node, ast.Tuple):
        return node.elts
    by_name = {keyword.arg: keyword.value for keyword in node.keywords}
    given = [*node.args, *(by_name[part] for part in PARTS[len(node.args) :] if part in by_name)][-len(PARTS) :]
    return [] if len(given) != len(PARTS) or any(isinstance(part, ast.Starred) for part in given) else given


def messages(parts: list[ast.expr], known: dict[str, ast.expr]) -> list[tuple[str, str, str]]:
    """Return the messages that one error may show; none where they are not in the source."""
    spelled = [[tidy(text) for text in spell(part, known)] for part in parts]
    every = itertools.islice(itertools.product(*spelled), MOST_VARIANTS) if spelled else ()
    return [
        (given, allowed if worded(allowed) else LISTED, remedy if worded(remedy) else SAID)
        for given, allowed, remedy in every
        if worded(given)
    ]


def worded(text: str) -> bool:
    """Return whether a part holds a word beside what is filled in."""
    return bool(re.search(r"[A-Za-z]{2}", text))


def spell(node: ast.expr, known: dict[str, ast.expr]) -> list[str]:
    """Return the texts that an expression may be, with … for what is filled in."""
    match node:
        case ast.Constant(value=str(text)):
            return [text]
        case ast.JoinedStr(values=values):
            return joined(values, known)
        case ast.FormattedValue(value=ast.IfExp() | ast.Name() as value):
            return spell(value, known)
        case ast.BinOp(op=ast.Add(), left=left, right=right):
            return joined([left, right], known)
        case ast.IfExp(body=body, orelse=orelse):
            return [*spell(body, known), *spell(orelse, known)][:MOST_VARIANTS]
        case ast.Name(id=name) if name in known:
            return spell(known[name], {other: value for other, value in known.items() if other != name})
        case _:
            return [FILLED]


def joined(nodes: list[ast.expr], known: dict[str, ast.expr]) -> list[str]:
    """Return what expressions side by side may be."""
    every = itertools.product(*(spell(node, known) for node in nodes))
    return ["".join(parts) for parts in itertools.islice(every, MOST_VARIANTS)]


def tidy(text: str) -> str:
    """Return a part for a table cell: one line, one … in a row, not too long."""
    text = re.sub(r"\s+", " ", text).strip()
    text = re.sub(rf"{FILLED}(?:[\s,;:]*{FILLED})+", FILLED, text)
    words = text.split(" ")
    return text if len(words) <= MOST_WORDS else " ".join(words[:MOST_WORDS]) + f" {FILLED}"


def sort_key(given: str) -> str:
    """Return what a message is sorted by: its first words that are always the same."""
    return re.sub(r"[^a-z0-9 ]", "", given.replace(FILLED, "").lower()).strip()


def room_of(path: Path) -> str:
    """Return the room of a file, as it is written in ARCHITECTURE.md; the floor of tacdata is one."""
    parts = path.relative_to(ROOT).parts
    if parts[0] != "tacdata":
        return parts[0]
    return f"tacdata/{parts[1]}" if len(parts) > 2 else "tacdata"


def about(room: str) -> str:
    """Return the first line of a room's docstring."""
    text = ast.get_docstring(ast.parse((ROOT / room / "__init__.py").read_text())) or ""
    return text.split("\n\n")[0].replace("\n", " ")


def page(found: list[Entry]) -> str:
    """Return the page: one table a room."""
    rooms = list(dict.fromkeys(entry.room for entry in found))
    parts = [HEAD, " · ".join(f"[{room}](#{room.replace('/', '')})" for room in rooms)]
    for room, group in itertools.groupby(found, lambda entry: entry.room):
        parts += [f"\n## {room}\n\n{about(room)}\n", "| message | allowed | remedy |", "|---|---|---|"]
        parts += [f"| {cell(e.given)} | {cell(e.allowed)} | {cell(e.remedy)} |" for e in group]
    return "\n".join(parts) + "\n"


def cell(text: str) -> str:
    """Return a text as it stands in a Markdown table."""
    return text.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
