"""Lines of serial monitors as columns: a time before an arrow, a name before each value, or frames of a matrix."""

import re
from collections import Counter

from tacdata.errors import FormatError
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.text.layout import text_layout

TAIL, SNIFFED, FEWEST = 16 * 1024, 256 * 1024, 10
"""Bytes at a text's end by which labels, and at its beginning by which a layout is recognized; fewest frames [1]."""
ALIKE = 0.8
"""Smallest share of last lines with the same labels [1]: the last one may be cut off."""
RECEIPT = re.compile(rb"\s*\[?(\d{1,2}:\d{2}:\d{2}[.,]\d+)\]?\s*->")
"""How a serial monitor marks when a line came."""
LABELLED = re.compile(r"([A-Za-z_][\w%/\[\]]*)[ \t]*[:=][ \t]*([-+]?\.?\d[^\s,;|]*|nan|NaN)")
"""A name with its value, as a serial plotter reads them."""
WITH_UNIT = re.compile(LABELLED.pattern + r"(?:[ \t]+([A-Za-z\u00b5%]+)(?![\w%]|[ \t]*[:=]))?")
"""The same with a unit behind it."""
BEFORE = re.compile(r"^\s*[\[(]?\s*(\d+(?:\.\d+)?)\s*([mu\u00b5]?s)?\s*[\])][ :]*(?=[A-Za-z])", re.MULTILINE)
"""A time in brackets before the first name."""
FRAME = re.compile(r"^([A-Za-z].*\d.*)\n((?:[ \t]*[-+.\d][-+.\d \t,;eE]*\n){2,64})(?![ \t]*[-+.\d])", re.MULTILINE)
"""A frame of a matrix: rows of numbers below a line with words and values. More rows are a trial."""


def without_labels(data: bytes) -> bytes:
    """Return lines of t:0.05,depth:0.1 or t=0.05 depth=0.1 as columns below a header; other text as it is."""
    text = BEFORE.sub(r"time=\1 \2\t", data.decode("utf-8", "replace"))
    tail = [line for line in text[-TAIL:].split("\n")[1:] if line.strip()]
    found = Counter(_names(line) for line in tail)
    names, count = found.most_common(1)[0] if found else ((), 0)
    if len(set(names)) < max(len(names), 2) or count < ALIKE * len(tail):
        return data
    if any(WITH_UNIT.sub("", line).strip(" \t,;|\r") for line in tail[: len(tail) // 2]):
        return data
    rows = ["\t".join(names)]
    for line in text.split("\n"):
        values = [value for _, value, _ in WITH_UNIT.findall(line)]
        rows.append("\t".join(values) if _names(line) == names else line)
    return "\n".join(rows).encode()


def _names(line: str) -> tuple[str, ...]:
    """Return the names of a line's values, with their units in brackets."""
    return tuple(f"{name} [{unit}]" if unit else name for name, _, unit in WITH_UNIT.findall(line))


def with_frames(data: bytes) -> bytes:
    """Return frames of a matrix as a row each below a header; other text as it is."""
    text = data.decode("utf-8", "replace")
    if not FRAME.search(text[-TAIL:]):
        return data
    header, count = Counter(_frame(match)[0] for match in FRAME.finditer(text)).most_common(1)[0]
    if count < FEWEST:
        return data
    # A frame of another shape stays: its lines are of another width, and counted as such.
    rows = FRAME.sub(lambda match: _frame(match)[1] if _frame(match)[0] == header else match[0], text)
    return f"{header}\n{rows}".encode()


def _frame(match: re.Match[str]) -> tuple[str, str]:
    """Return the names and the values of a frame as lines with tabs."""
    pairs = WITH_UNIT.findall(re.sub(r"^([A-Za-z]+)[ #]+(?=\d)", r"\1=", match[1]))
    rows = [re.split(r"[\s,;]+", row.strip(" \t,;")) for row in match[2].splitlines()]
    cells = {f"r{r}c{c}": cell for r, row in enumerate(rows) for c, cell in enumerate(row)}
    names = [f"{name} [{unit}]" if unit else name for name, _, unit in pairs]
    return "\t".join([*names, *cells]), "\t".join([*(value for _, value, _ in pairs), *cells.values()]) + "\n"


def with_receipt(data: bytes) -> bytes:
    """Return a serial monitor's lines with the time before "->" as a column of its own; other text as it is."""
    lines = data.split(b"\n")
    # By the second half: a board that starts prints a header and messages first.
    tail = [line for line in lines[len(lines) // 2 :] if line.strip()]
    if 2 * sum(bool(RECEIPT.match(line)) for line in tail) <= len(tail):
        return data
    cut = [line.partition(b"->")[2].strip() if RECEIPT.match(line) else b"" for line in lines]
    named = without_labels(b"\n".join(cut)).split(b"\n")
    lines, cut = [*[b""] * (len(named) - len(cut)), *lines], named  # the names are a line more
    try:
        layout = text_layout(b"\n".join(cut)[:SNIFFED].decode("utf-8", "ignore"), ReadOptions(), "")
    except FormatError:  # the reader names it with its file
        return data
    between = b"\t" if layout.delimiter == " " else layout.delimiter.encode()
    bodies = [between.join(text.split()) if layout.delimiter == " " else text for text in cut]
    begin = [b"received" if number < layout.skip else RECEIPT.match(line) for number, line in enumerate(lines)]
    rows = [
        (first if isinstance(first, bytes) else first[1]) + between + text if first and text else b""
        for first, text in zip(begin, bodies, strict=True)
    ]
    return b"\n".join(rows)
