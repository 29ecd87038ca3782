"""Text files of columns: CSV, TSV, semicolons, blanks; with or without a header; point or comma as decimal sign."""

import gzip
import io
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.formats.source_format import SourceFormat, kind_of_bytes
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.source_table import SourceTable
from tacdata.importing.text.encoding import ENCODINGS, encoding_of
from tacdata.importing.text.inner_headers import without_headers
from tacdata.importing.text.layout import (
    COMMENTS,
    DELIMITERS,
    MISSING,
    THOUSANDS,
    TextLayout,
    is_comment,
    is_number,
    split,
    text_layout,
)
from tacdata.importing.text.serial_lines import with_frames, with_receipt, without_labels
from tacdata.importing.text.stated_rate import stated_counts, stated_rate
from tacdata.importing.text.written_numbers import ungrouped

SHOWN = 40
"""Letters of a text that an error quotes."""
FEW_LINES, LONG, MOST_TURNED = 64, 10, 64 * 1024 * 1024
"""Most lines, smallest ratio of fields to lines, and largest size [byte] of a text whose lines are columns."""
TAIL, FEWEST = 16 * 1024, 20
"""Bytes and rows at a file's end from which a truncated number is recognized."""
UNREADABLE = 0.01
"""Largest share of a column's cells that hold no number and are missing [1]; above it the file is refused."""
WORDS, OF_WORDS = 5, 0.05
"""Most different words that may stand for no value, and the largest share of their cells [1]."""
SNIFFED, HEAD, SETTINGS = 256 * 1024, 4096, 16 * 1024 * 1024
"""Bytes from which the layout is recognized; among which a header's cells may hold line breaks; of long first lines."""
EXPONENT = re.compile(rb"(?<=\d)[dD](?=[-+]\d\d)")
"""The exponent's sign of Fortran, as in 1.20D+01."""
TYPOGRAPHIC_MINUS = re.compile(rb"\xe2\x88\x92(?=[\d.,])")
"""The minus of a text program before a number, in UTF-8."""
HEXADECIMAL = re.compile(r"0[xX][0-9A-Fa-f]+")
"""A number to base 16, as boards print registers."""
LARGEST = 256 * 1024 * 1024
"""Most bytes that a compressed text may become; the memory holds them some four times over."""
MARKS = {b"\xff\xfe\0\0": "utf-32", b"\0\0\xfe\xff": "utf-32", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
"""Byte order marks and their encodings; the longer ones first."""


class UnknownWord(FormatError):
    """Cells of a column of numbers that hold a word."""

    word = ""
    """The word, if it is one alone."""


class Csv(SourceFormat):
    """Columns of text."""

    endings = (".csv", ".tsv", ".txt", ".dat", ".asc", ".log", ".lvm", ".prn", ".csv.gz", ".txt.gz", ".tsv.gz")

    def read(self, path: Path, options: ReadOptions) -> SourceTable:
        """Read the file by Arrow's reader, with the layout of `text_layout`; see the base class."""
        data, notes = _decoded(path, options)
        return table_of(path, data, options, notes)


def table_of(path: Path, data: bytes, options: ReadOptions, notes: list[str]) -> SourceTable:
    """Return text in UTF-8 as a table.

    Args:
        path: Where it comes from, for messages.
        data: The text.
        options: Of this file in the mapping; see `SourceFormat.read`.
        notes: Notes so far; those on the rows are added.

    Raises:
        FormatError: If it has no rows of numbers.
    """
    data = _upright(without_labels(with_receipt(with_frames(data))), options, path, notes)
    # A line of settings may be longer than all that is looked at otherwise.
    begin = data[:SNIFFED] if data.count(b"\n", 0, SNIFFED) >= FEWEST else data[: SETTINGS + SNIFFED]
    head = begin.decode("utf-8", "ignore")
    layout = text_layout(head, options, str(path))
    body, comments, headers = _body(data, layout, options.missing)
    if comments:
        notes.append(f"{path.name}: {comments} comment lines among the rows are left out")
    if headers:
        notes.append(f"{path.name}: {headers} repeated header lines among the rows are left out")
    if twice := [name for name in layout.names if name.endswith("'")]:
        notes.append(f"{path.name}: names that are given twice; the later columns are called {', '.join(twice)}")
    if not body.strip():
        raise FormatError(f"{path} has a header and no row", "one row of data or more", "leave it out")
    columns, skipped, doubts = _parsed(body, layout, [*MISSING, *options.missing], path)
    if not skipped and _is_cut(body, layout):
        last_column = columns[layout.names[-1]]
        columns[layout.names[-1]] = np.append(last_column[:-1], np.nan)
        doubts.append(f"{path.name}: the last number is cut off with the file and is missing")
    if skipped:
        notes.append(f"{path.name}: {skipped} lines with another number of columns are left out")
    rate = stated_rate(head, layout.skip)
    step = columns.get("Increment", np.empty(0))  # an oscilloscope gives it in the first row alone
    if step.dtype != object and np.isfinite(step).sum() == 1 and np.nansum(step) > 0:
        rate = float(1 / np.nansum(step))
    units = {**layout.units, **stated_counts(head, layout.skip, columns)}
    return SourceTable(path, columns, units, notes=tuple(notes), doubts=tuple(doubts), rate=rate)


def _upright(data: bytes, options: ReadOptions, path: Path, notes: list[str]) -> bytes:
    """Return text with a column for each of its few, very long lines; other text as it is."""
    lines = [line for line in data[:MOST_TURNED].split(b"\n") if line.strip()]
    is_short = 2 <= len(lines) <= FEW_LINES and len(data) <= MOST_TURNED
    if not is_short or options.transpose is False:
        return data
    rows = [line.decode("utf-8", "ignore") for line in lines]
    marks = [mark for mark in DELIMITERS if mark != " "] + [" "]
    # By the line with the fewest: a delimiter stands in every line.
    delimiter = max(marks, key=lambda mark: min(row.count(mark) for row in rows))
    table = [split(row, delimiter) for row in rows]
    widths = {len(row) for row in table}
    if len(widths) > 1 or widths.pop() < LONG * len(table):
        return data
    notes.append(f"{path.name}: {len(table)} lines of {len(table[0])} fields; each line is taken for a column")
    mark = "\t" if delimiter == " " else delimiter
    return "\n".join(mark.join(fields) for fields in zip(*table, strict=True)).encode() + b"\n"


def _is_cut(body: bytes, layout: TextLayout) -> bool:
    """Return whether a file ends inside a number: without a line end, and with fewer digits than all rows before."""
    if body.endswith(b"\n") or layout.kinds[-1] != "float":
        return False
    lines = [line for line in body[-TAIL:].decode("utf-8", "ignore").split("\n")[1:] if line.strip()]
    fields = [split(line, layout.delimiter)[-1].strip() for line in lines]
    places = [len(field.partition(layout.decimal)[2]) if layout.decimal in field else 0 for field in fields]
    if len(fields) < FEWEST:
        return False
    # With a fixed number of decimals, a cut row has fewer; without any, fewer digits than all before.
    if min(places[:-1]) == max(places[:-1]) > 0:
        return places[-1] < places[0]
    return max(places) == 0 and len(fields[-1].lstrip("-")) < min(len(field.lstrip("-")) for field in fields[:-1])


def _decoded(path: Path, options: ReadOptions) -> tuple[bytes, list[str]]:
    """Return the file's text in UTF-8 with plain line ends."""
    raw = path.read_bytes()
    if path.suffix == ".gz":
        if raw and not raw.startswith(b"\x1f\x8b"):
            plain = path.name.removesuffix(".gz")
            raise FormatError(f"{path} is named .gz and is not compressed", "a gzip file", f"rename it to {plain}")
        with gzip.open(io.BytesIO(raw)) as stream:
            raw = stream.read(LARGEST + 1)
        if len(raw) > LARGEST:
            raise FormatError(
                f"{path} holds more than {LARGEST >> 20} MiB of text",
                "a text that the memory holds several times over",
                "unpack it, and split it into files of fewer rows",
            )
    notes: list[str] = []
    tried = options.encoding
    # A mapping for files of several instruments may name several encodings; the first that fits is taken.
    if isinstance(tried, list):
        tried = next((name for name in tried if _decodes(raw, name)), tried[-1])
    encoding = tried or next((name for mark, name in MARKS.items() if raw.startswith(mark)), None)
    if encoding and not tried and 8 * raw[:HEAD].count(0) < len(raw[:HEAD]):
        encoding = None  # digits in UTF-16 hold a zero byte each: these are noise of a port that was just opened
    if b"\0" in raw and not encoding:
        raw = _without_zeros(path, raw, notes)
    if encoding:
        try:
            raw = raw.decode(encoding).encode()
        except (UnicodeDecodeError, LookupError) as error:
            raise FormatError(f"{path}: {error}", "the file's encoding", "correct encoding in the mapping") from None
    else:
        try:
            raw.decode()
        except UnicodeDecodeError:
            encoding, doubtful = encoding_of(raw)
            raw = raw.decode(encoding).encode()
            advice = " by guess; if names look wrong, give encoding under the file" if doubtful else ""
            notes.append(f"{path.name}: not UTF-8, read as {ENCODINGS.get(encoding, encoding)}{advice}")
    # Windows ends lines with \r\n, and an old Macintosh with \r: from here on every line ends with \n.
    raw = EXPONENT.sub(b"E", TYPOGRAPHIC_MINUS.sub(b"-", raw))
    raw = raw.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return _whole_cells(raw[:HEAD]) + raw[HEAD:], notes


def _decodes(raw: bytes, encoding: str) -> bool:
    try:
        raw.decode(encoding)
    except (UnicodeDecodeError, LookupError):
        return False
    return True


def _whole_cells(head: bytes) -> bytes:
    """Return a file's first lines without breaks inside quotes: a name and its unit, as a rule."""
    lines = head.split(b"\n")
    quotes = [line.count(b'"') for line in lines]
    # An odd number of quotes in a line means that a quoted cell goes on in the next one.
    for number in range(len(lines) - 1):
        ends = next((k for k in range(number + 1, len(lines)) if quotes[k] % 2), 0) if quotes[number] % 2 else 0
        # In between, a line ends one cell and begins another, and a cell has up to four lines.
        with_quotes = [k for k in range(number, ends + 1) if quotes[k]]
        if ends and max(after - before for before, after in pairwise(with_quotes)) < 4:
            lines[number : ends + 1] = [b" ".join(lines[number : ends + 1])]
            return _whole_cells(b"\n".join(lines))
    return head


def _without_zeros(path: Path, raw: bytes, notes: list[str]) -> bytes:
    """Return text without the zero bytes at a file's end, of a logger without power, or in its first line.

    Raises:
        FormatError: If zero bytes stand elsewhere: it is another kind of file, or another encoding.
    """
    if kind := kind_of_bytes(raw):
        raise FormatError(f"{path} is {kind}, no text", "a text file of columns", "give it the ending of what it is")
    body = raw.rstrip(b"\0")
    if body and b"\0" not in body:
        notes.append(f"{path.name}: {len(raw) - len(body)} zero bytes at its end are left out")
        return body
    body = raw.partition(b"\n")[2]
    if body and b"\0" not in body:
        notes.append(f"{path.name}: its first line holds zero bytes, as of a port that was just opened; left out")
        return body
    # In UTF-16 digits and Latin letters have a zero byte each: in little endian the second.
    for start, name in ((1, "utf-16-le"), (0, "utf-16-be")):
        if raw[start:4096:2].count(0) > 0.9 * len(raw[start:4096:2]):
            raise FormatError(
                f"{path} is UTF-16 by all appearance, without its mark",
                "UTF-8, or an encoding that is given",
                f"give encoding: {name} under files in the mapping",
            )
    line = raw.count(b"\n", 0, raw.index(b"\0")) + 1
    raise FormatError(
        f"{path} is not text: {raw.count(bytes(1))} zero bytes, the first in line {line}",
        "a text file of columns",
        "cut them out, as a logger without power leaves them, or name another format in the mapping",
    )


def _body(data: bytes, layout: TextLayout, missing: tuple[str, ...]) -> tuple[bytes, int, int]:
    """Return the rows without comments and repeated headers, and how many of each stood among them."""
    start, comments, headers = 0, 0, 0
    for _ in range(layout.skip):
        start = data.index(b"\n", start) + 1
    body = data[start:]
    head = data[:start].rstrip(b"\n").rsplit(b"\n", 1)[-1]
    # A logger that starts again writes its header again.
    if head.strip() and not is_comment(head.decode("utf-8", "ignore"), missing) and b"\n" + head + b"\n" in body:
        lines = body.split(b"\n")
        body = b"\n".join(line for line in lines if line != head)
        headers = lines.count(head)
    marks = tuple(mark.encode() for mark in COMMENTS)
    if any(mark in body for mark in marks):
        lines = body.split(b"\n")
        rows = [line for line in lines if not is_comment(line.decode("utf-8", "ignore"), missing)]
        body, comments = b"\n".join(rows), len(lines) - len(rows)
    if layout.delimiter == " ":
        body = b"\n".join(b" ".join(line.split()) for line in body.split(b"\n"))
    return body, comments, headers


def _parsed(
    body: bytes, layout: TextLayout, missing: list[str], path: Path
) -> tuple[dict[str, np.ndarray], int, list[str]]:
    """Parse with the column types of the layout.

    Returns:
        Columns by name, the number of lines of another width, and notes on missing values, as sentences.
    """
    import pyarrow as pa

    kinds = {"float": pa.float64(), "int": pa.int64(), "text": pa.string()}
    types = {name: kinds[kind] for name, kind in zip(layout.names, layout.kinds, strict=True)}
    try:
        table, skipped = _arrow(body, layout, missing, types)
    except pa.ArrowInvalid:
        # A single cell without a number makes Arrow refuse the file. As text, the cell can be named or left out.
        table, skipped = _arrow(body, layout, missing, dict.fromkeys(layout.names, pa.string()))
    headers = 0
    if any(
        kind != "text" and pa.types.is_string(table.column(name).type)
        for name, kind in zip(layout.names, layout.kinds, strict=True)
    ):
        table, headers = without_headers(table, layout, path)
    columns, doubts = {}, [f"{path.name}: {headers} repeated header lines among the rows are left out"] * bool(headers)
    for name, kind in zip(layout.names, layout.kinds, strict=True):
        column = table.column(name)
        if kind == "text" or not pa.types.is_string(column.type):
            columns[name] = _of_base_16(_array(column, kind))
        else:
            columns[name] = _numbers(column.to_pylist(), layout, name, path, doubts)
    return columns, skipped, doubts


def _arrow(body: bytes, layout: TextLayout, missing: list[str], types: dict[str, Any]) -> tuple[Any, int]:
    from pyarrow import csv

    skipped: list[int] = []

    def other_width(row: Any) -> str:
        skipped.append(1)
        return "skip"

    table = csv.read_csv(
        io.BytesIO(body),
        csv.ReadOptions(column_names=list(layout.names), use_threads=False),
        csv.ParseOptions(delimiter=layout.delimiter, invalid_row_handler=other_width),
        csv.ConvertOptions(
            column_types=types, null_values=missing, strings_can_be_null=True, decimal_point=layout.decimal
        ),
    )
    return table, len(skipped)


def _array(column: Any, kind: str) -> np.ndarray:
    if kind == "text":
        return np.array(column.to_pylist(), dtype=object)
    if kind == "int" and not column.null_count:
        return column.to_numpy()
    return np.asarray(column.to_numpy(), dtype=float)


def _of_base_16(values: np.ndarray) -> np.ndarray:
    """Return texts as 0x0A3F as numbers, if all of them are so written."""
    if values.dtype != object or not all(text is None or HEXADECIMAL.fullmatch(text.strip()) for text in values):
        return values
    return np.array([np.nan if text is None else float(int(text, 16)) for text in values.tolist()])


def _numbers(texts: list[str | None], layout: TextLayout, name: str, path: Path, doubts: list[str]) -> np.ndarray:
    """Return texts as numbers, shape (rows,). A few cells without a number are missing and counted in ``doubts``.

    Raises:
        FormatError: If many cells hold no number, or one holds a number with a sign between its thousands.
    """
    values, wrong = np.full(len(texts), np.nan), []
    for row, text in enumerate(texts):
        field = "" if text is None else text.strip()
        if not is_number(field, layout.decimal):
            wrong.append(row)
        elif field not in MISSING:
            values[row] = float(field.replace(",", ".") if layout.decimal == "," else field)
    fields = ["" if text is None or text.strip() in MISSING else text.strip() for text in texts]
    if wrong and (plain := ungrouped(fields)):
        return np.array([float(text) if text else np.nan for text in plain])
    if not wrong:
        return values
    grouped = next((row for row in wrong if THOUSANDS.fullmatch((texts[row] or "").strip())), None)
    row = wrong[0] if grouped is None else grouped
    cell = repr((texts[row] or "").strip()[:SHOWN])
    words = {(texts[row] or "").strip() for row in wrong}
    share = OF_WORDS if len(words) <= WORDS else UNREADABLE
    # A number with a sign between thousands can be read in two ways, so one is enough to refuse.
    if grouped is not None or len(wrong) > share * len(texts):
        error = UnknownWord(
            f"{path}: column {name}, row {row + 1} of the data: {cell}",
            f"a number with a decimal {'comma' if layout.decimal == ',' else 'point'}",
            f"add {cell} to missing in the mapping if it means no value, else correct the file"
            if grouped is None
            else "save it again without a sign between thousands",
        )
        error.word = words.pop() if len(words) == 1 and grouped is None else ""
        raise error
    doubts.append(
        f"{path.name}: {len(wrong)} cells of {name} hold no number and are missing, the first in row {row + 1} of the "
        f"data: {cell}"
    )
    return values
