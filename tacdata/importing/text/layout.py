"""Recognizes how a text file of numbers is laid out: delimiter, decimal sign, header and units."""

import csv
import re
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

from tacdata.documents import composed
from tacdata.errors import FormatError
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.units import BRACKETED, OTHERS, plain, quantity_of, split_unit

COMMENTS = ("#", "%", "//")
SHEET_ERRORS = tuple(
    (
        "#N/A #DIV/0! #NAME? #NULL! #NUM! #REF! #VALUE! #SPILL! #CALC! #FIELD! #BLOCKED! #CONNECT! #BUSY! "
        "#UNKNOWN! #GETTING_DATA #WERT! #ZAHL! #BEZUG! #NV #VALEUR! #NOMBRE! #VALOR! #NUM. "
    ).split()
)
"""Error values of spreadsheets, in cells without a value; they begin like a comment and are none."""
MISSING = (
    "",
    "no data",
    "No Data",
    "Bad Input",
    *(
        "nan NaN NAN na NA n/a N/A n.a. null NULL (null) None <NA> NaT - -- --- ? -nan -nan(ind) nan(ind) "
        "1.#QNAN -1.#QNAN 1.#IND -1.#IND 1.#INF -1.#INF N.A. n.d. k.A. s.o. \\N \u2013 \u2014 \u221e -\u221e +\u221e "
    ).split(),
    *(f"{sign}1,#{word}" for sign in ("", "-") for word in ("QNAN", "IND", "INF")),
    *(f"{sign}1.#{word}" for sign in ("", "-") for word in ("IND0", "IND00", "INF0", "INF00", "QNAN0", "QNB", "J")),
    *(f"Err:{number}" for number in range(501, 541)),
    *("*" * width for width in range(3, 25)),
    *SHEET_ERRORS,
)
"""Texts that stand for a missing value in any file: C, LibreOffice, Fortran and spreadsheets write some of them."""
DELIMITERS = ("\t", ";", ",", "|", " ")
GUESSED = ("delimiter", "decimal")
"""Options of a mapping that can be inferred from the file instead."""
THOUSANDS = re.compile(r"[-+]?\d{1,3}(([.,' \u00a0\u202f])\d{3})(\2\d{3})*([.,]\d+)?")
"""A number with a sign between its thousands."""
THREE, DECIMAL = re.compile(r"[-+]?[1-9]\d{0,2}([.,])\d{3}"), re.compile(r"[-+]?\d*([.,])\d+([eE][-+]?\d+)?")
"""A number that may be thousands, or have three decimal places; a number with a decimal sign."""
SAMPLE, TAIL = 2000, 100
"""Lines that are examined, and the last of them, which tell the layout."""


REMARK = re.compile(r"comment|remark|note|bemerkung|event|marker", re.IGNORECASE)
"""Last name of a header whose column is written in some rows alone."""
LABEL = re.compile(r"(\w+[_ ])?(units?|einheit(en)?)([_ ]\w+)?:?", re.IGNORECASE)
"""First cell of a line of units, which is no unit."""
ROW_NAME = "row"
"""Name of a column of row names that the header leaves out."""
LINES_OF_HEADER = 6
"""A header with numbers has hardly more lines."""


@dataclass(frozen=True)
class TextLayout:
    """The layout of a text file."""

    delimiter: str
    """The delimiter; a blank means any white space."""
    decimal: str
    """Decimal sign: a point or a comma."""
    skip: int
    """Lines before the first row of data."""
    names: tuple[str, ...]
    """Column names, one a column; "0", "1", ... in a file without a header."""
    units: dict[str, str]
    """Unit of each column, where the header gives one."""
    kinds: tuple[str, ...]
    """``float``, ``int`` (too long for a float) or ``text`` of each column."""


def is_comment(line: str, missing: tuple[str, ...] = ()) -> bool:
    """Return whether a line is a comment: it begins like one, and not with a text for a missing value."""
    bare = line.lstrip().lstrip("\"'")
    return bare.startswith(COMMENTS) and not bare.startswith((*SHEET_ERRORS, *(text for text in missing if text)))


def text_layout(text: str, options: ReadOptions, origin: str) -> TextLayout:
    """Recognize the layout from a file's beginning; the mapping's ``options`` take precedence.

    Raises:
        FormatError: If there are no rows of one and the same number of columns.
    """
    if not text.strip():
        raise FormatError(f"{origin} is empty", "a text file of columns", "leave it out, or copy it again")
    lines = text.split("\n")[:SAMPLE]  # splitlines would part lines at other signs, too, which counts rows wrongly
    skip = options.skip
    lines_of_data = [line for line in lines[skip:] if line.strip() and not is_comment(line, options.missing)]
    delimiter = {"tab": "\t", "space": " "}.get(options.delimiter, options.delimiter)
    delimiter = delimiter or _delimiter(lines_of_data)
    rows = [split(line, delimiter) for line in lines_of_data]
    width = Counter(len(row) for row in rows[-_told(rows) :]).most_common(1)[0][0] if rows else 0
    decimal = options.decimal or _decimal(rows)
    first = _first_row(rows, width, decimal)
    if first is None:
        settings = [f"{name} {value!r}" for name in GUESSED if (value := getattr(options, name))]
        given = f", read with {' and '.join(settings)} as the mapping says" if settings else ""
        raise FormatError(
            f"{origin}: no row of numbers among its first {len(lines)} lines{given}",
            "a text file of columns, with or without a header",
            _otherwise(text, options, origin) or "give delimiter, decimal, skip or header under files in the mapping",
        )
    first = _with_wider_rows(rows, first, decimal)
    _refuse_commas_for_both(rows[:first], rows[first:], delimiter, width, origin)
    header = [row for row in rows[:first] if len(row) in (width, width - 1, width + 1) and any(row)]
    header = header or _commented_header(lines[skip:], lines_of_data[first], delimiter, width)
    if not options.header:
        header, first = [], next(k for k, row in enumerate(rows) if len(row) == width)
    sample = [row for row in rows[first:] if len(row) == width]
    if header and len(header[-1]) == width - 1 and _are_row_names(sample, decimal):
        header = [[ROW_NAME, *row] if len(row) == width - 1 else row for row in header]
    _refuse_other_number(header, sample, origin)
    names, units = _names(header, width)
    start = lines.index(lines_of_data[first], skip)
    _refuse_unclear_signs(sample, names, origin)
    kinds = tuple(_kind([row[k] for row in sample], decimal) for k in range(width))
    return TextLayout(delimiter, decimal, start, names, units, kinds)


def _are_row_names(rows: list[list[str]], decimal: str) -> bool:
    """Return whether the first column names or numbers the rows, as R writes it without a name in the header."""
    first, last = [row[0] for row in rows], [row[-1] for row in rows]
    if len(rows) < 2 or not all(last):  # a delimiter at the end of each row makes an empty column instead
        return False
    begin = int(first[0]) if first[0].isdigit() else -1
    return first == [str(begin + k) for k in range(len(first))] or not any(is_number(name, decimal) for name in first)


def _otherwise(text: str, options: ReadOptions, origin: str) -> str:
    """Return a layout that reads a file which the mapping's delimiter or decimal sign does not; "" if there is none."""
    remainder = replace(options, delimiter="", decimal="")
    if remainder == options:
        return ""
    try:
        layout = text_layout(text, remainder, origin)
    except FormatError:
        return ""
    delimiter = {"\t": "tab", " ": "space"}.get(layout.delimiter, layout.delimiter)
    return f"write delimiter: {delimiter!r} and decimal: {layout.decimal!r} in the mapping, by which it can be read"


def _refuse_commas_for_both(
    heading: list[list[str]], rows: list[list[str]], delimiter: str, width: int, origin: str
) -> None:
    """Refuse rows whose commas part the fields and stand for decimal points: the header has fewer names than fields.

    Raises:
        FormatError: If they do.
    """
    names = len(heading[-1]) if heading else width
    wide = [row for row in rows if len(row) == width]
    are_whole = all(re.fullmatch(r"[-+]?\d+", field) for row in wide for field in row)
    if delimiter == "," and names + 1 < width <= 2 * names and are_whole:
        raise FormatError(
            f"{origin}: {names} names in the header, and {width} whole numbers a row: its commas part the fields and "
            "are decimal points too",
            "one sign for each",
            "save it again with semicolons or tabs between the fields, or with decimal points",
        )


def _refuse_other_number(header: list[list[str]], rows: list[list[str]], origin: str) -> None:
    """Refuse rows with a value more or less than the header has names: which of the columns lacks one is not known.

    Raises:
        FormatError: If they are so.
    """
    names, width = header[-1] if header else [], len(rows[0])
    unnamed = 0 < max(map(len, header), default=0) < width and any(row[-1] for row in rows)
    if unnamed or any(name and not REMARK.search(name) for name in names[width:]):
        raise FormatError(
            f"{origin}: {len(names)} names in the header, and {width} values in a row",
            "a name for each column",
            "correct the header in a copy; or give header: false, and name the columns by numbers from 0",
        )


def _refuse_unclear_signs(rows: list[list[str]], names: tuple[str, ...], origin: str) -> None:
    """Refuse a column of numbers as 10.000 in a file whose other columns have decimal commas, or the other way round.

    Raises:
        FormatError: Naming the column.
    """
    columns = [[field for field in column if "." in field or "," in field] for column in zip(*rows, strict=True)]
    decimal = {
        match[1] for fields in columns for field in fields
        if (match := DECIMAL.fullmatch(field)) and not THREE.fullmatch(field)
    }  # fmt: skip
    for name, fields in zip(names, columns, strict=True):
        signs = {match[1] for field in fields if (match := THREE.fullmatch(field))}
        if len(signs) == 1 and len(decimal) == 1 and signs != decimal and all(map(THREE.fullmatch, fields)):
            raise FormatError(
                f"{origin}: column {name}: {fields[0]!r} has {min(signs)!r} where others have {min(decimal)!r} before "
                "decimal places: does it separate thousands?",
                "one decimal sign in all columns",
                "save it again without signs between thousands, and with one decimal sign",
            )


def _commented_header(lines: list[str], first: str, delimiter: str, width: int) -> list[list[str]]:
    """Return names, and units below them, from comments before the data with as many fields.

    Those behind "columns:" and "units:" come first, then those of the last comment, as NumPy writes it.
    """
    comments = [line.lstrip().lstrip("#%/").strip() for line in lines[: lines.index(first)] if line.strip()]
    labelled = {label.lower(): split(fields, delimiter) for label, _, fields in (c.partition(":") for c in comments)}
    names = [labelled.get(label, []) for label in ("columns", "fields", "names", "channels")]
    names = next((fields for fields in names if len(fields) == width), None)
    if names:
        return [names, *(labelled[label] for label in ("units",) if len(labelled.get(label, ())) == width)]
    fields = split(comments[-1], delimiter) if comments else []
    return [fields] if len(fields) == width else []


def split(line: str, delimiter: str) -> list[str]:
    """Return the fields of a line, without quotes and blanks around them."""
    if delimiter == " ":
        return [field.strip('"') for field in line.split()]
    return [field.strip() for field in next(csv.reader([line], delimiter=delimiter))]


def is_number(field: str, decimal: str) -> bool:
    """Whether a field is a number or a missing value."""
    if field in MISSING:
        return True
    try:
        float(field.replace(",", ".") if decimal == "," else field)
    except ValueError:
        return False
    # Python reads 1_000 as a number; in a measured file it is a name.
    return "_" not in field


def _told(lines: list[Any]) -> int:
    """Return how many of the last lines tell the layout: no header reaches as far."""
    return max(min(len(lines) // 2, TAIL), 1)


def _delimiter(lines: list[str]) -> str:
    tail = lines[-_told(lines) :]
    for delimiter in DELIMITERS:
        widths = Counter(len(split(line, delimiter)) for line in tail)
        width, count = widths.most_common(1)[0] if widths else (1, 0)
        # Not all lines: the last one may be cut off, and a text may contain the delimiter.
        if width > 1 and count >= 0.8 * len(tail):
            return delimiter
    return ","


def _decimal(rows: list[list[str]]) -> str:
    fields = [field for row in rows for field in row]
    commas = sum(bool(re.fullmatch(r"[-+]?\d*,\d+([eE][-+]?\d+)?", field)) for field in fields)
    points = sum(bool(re.fullmatch(r"[-+]?\d*\.\d+([eE][-+]?\d+)?", field)) for field in fields)
    return "," if commas > points else "."


def _first_row(rows: list[list[str]], width: int, decimal: str) -> int | None:
    """Return the first row of data: the first with numbers wherever most later rows have them.

    So a row may hold more words than numbers, and a header more numbers than words.
    """
    wide = [row for row in rows if len(row) == width]
    tail = wide[len(wide) // 2 :]
    flags = [[is_number(field, decimal) and field not in MISSING for field in row] for row in tail]
    numeric = [k for k in range(width) if 2 * sum(row[k] for row in flags) > len(flags)]
    if not numeric:
        return None
    for number, row in enumerate(rows):
        if len(row) != width:
            continue
        flags = [is_number(row[k], decimal) and row[k] not in MISSING for k in numeric]
        # A word among the numbers of the first rows makes no header of them: the row before has no numbers.
        above = rows[number - 1] if number else []
        named = len(above) == width and not any(is_number(above[k], decimal) for k in numeric)
        # A header of several lines may tell a rate or a date first: names without a number follow.
        later = [line for line in rows[number + 1 : number + LINES_OF_HEADER] if len(line) == width]
        named = named and all(any(is_number(line[k], decimal) for k in numeric) for line in later)
        if any(flags) and (
            all(is_number(row[k], decimal) for k in numeric) or (named and 2 * sum(flags) >= len(flags))
        ):
            return number
    return None


def _with_wider_rows(rows: list[list[str]], first: int, decimal: str) -> int:
    """Return the first row of data among those of another width, too: LabVIEW writes a remark behind the first one."""
    numeric = [is_number(field, decimal) for field in rows[first]]
    while first:
        flags = [is_number(field, decimal) for field in rows[first - 1]]
        common = min(len(flags), len(numeric))
        if common < 2 or not any(flags) or flags[:common] != numeric[:common]:
            break
        first -= 1
    return first


def _names(header: list[list[str]], width: int) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the names of columns and their units from the lines of a header, the last of which precedes the rows.

    Names may stand above units, and groups above or below both. A name of several columns has its group before it.
    """
    if not header:
        return tuple(str(k) for k in range(width)), {}
    whole = [[field.lstrip("\ufeff").strip() for field in [*row, *[""] * width]] for row in header[-LINES_OF_HEADER:]]
    rows = [row[:width] for row in whole]
    below = next((k for k in range(len(rows) - 1, 0, -1) if are_units(rows[k])), None)
    if below is not None and not all(_filled(rows[:below])[1:]):
        below = None
    # LabVIEW writes units above the names, behind Y_Unit_Label; an oscilloscope shifts them by that.
    above = next((row for row in whole[-2::-1] if LABEL.fullmatch(row[0]) and any(map(quantity_of, row[1:]))), None)
    above = above and above[any(above[width:]) :]
    units_row = rows[below] if below is not None else above
    titles = _filled(rows[:below])
    numeric = [any(field and field not in MISSING and is_number(field, ".") for field in row) for row in rows]
    first = max((k + 1 for k, holds_numbers in enumerate(numeric) if holds_numbers), default=0)
    groups = [row for k, row in enumerate(rows) if first <= k != below and row != titles]
    names: list[str] = []
    units: dict[str, str] = {}
    for k, title in enumerate(titles):
        name = composed(title) or str(k)
        if titles.count(title) > 1 and title:
            name = " ".join([*_groups(groups, k, title), name])
        # Columns are keyed by name: a second one of the same name must not replace the first.
        while name in names:
            name += "'"
        names.append(name)
        unit = (units_row[k].strip("[]() ") if units_row else "") or split_unit(name)[1]
        if unit and not unit.isdigit() and not LABEL.fullmatch(unit):  # "pos (5)" is the fifth's
            units[name] = unit
    return tuple(names), units


def _filled(rows: list[list[str]]) -> list[str]:
    """Return the last line of titles, with those of the line above it where it has none."""
    last = rows[-1]
    if len(rows) < 2 or all(last) or not all(above or field for above, field in zip(rows[-2], last, strict=True)):
        return last
    return [field or above for above, field in zip(rows[-2], last, strict=True)]


def _groups(rows: list[list[str]], column: int, title: str) -> list[str]:
    """Return the nearest title of a group above a column; it holds until the next one in its line."""
    for row in reversed(rows):
        group = next((field for field in reversed(row[: column + 1]) if field), "")
        if group and group != title and len({field for field in row if field}) > 1:
            return [composed(group)]
    return []


def are_units(fields: list[str]) -> bool:
    """Return whether a second header line gives units: short, and at least half of them in brackets or known."""
    texts = [field for field in fields if field]
    is_unit = [
        bool(re.fullmatch(BRACKETED, field)) or quantity_of(field) or plain(field).lower() in OTHERS for field in texts
    ]
    is_short = all(len(field.strip("[]() ")) <= 8 or quantity_of(field) for field in texts)
    return is_short and 2 * sum(map(bool, is_unit)) >= max(len(texts), 1)


def _kind(fields: list[str], decimal: str) -> str:
    values = [field for field in fields if field not in MISSING]
    numbers = [is_number(field, decimal) for field in values]
    if not values or (2 * sum(numbers) >= len(values) and any(numbers)):
        # From 16 digits on, as in Unix nanoseconds, a float64 would round.
        long = values and all(re.fullmatch(r"[-+]?\d{16,}", field) for field in values)
        return "int" if long else "float"
    return "text"
