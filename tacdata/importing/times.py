"""Clocks of foreign files as nanoseconds."""

import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.mapping import SourceClock
from tacdata.importing.source_table import SourceTable, single, unit_of
from tacdata.importing.text.layout import THOUSANDS
from tacdata.importing.text.months import in_english
from tacdata.importing.text.times_of_day import DAY, digits_of_day, times_of_day
from tacdata.importing.units import FACTORS, clock_unit, factor, plain

YEAR_2000, YEAR_2100 = 946_684_800.0, 4_102_444_800.0
"""Unix times between which a clock that does not say its zero is taken for Unix time [s]."""
SINCE_1904 = 2_082_844_800.0
"""From LabVIEW's zero to that of Unix [s]."""
DAY_ZERO = {"datenum": 719_529.0, "excel": 25_569.0}
"""Clocks that count days: the day on which 1970 begins, in MATLAB's datenum and in Excel's serial time [d]."""
FASTEST = 100_000.0
"""Rows a second above which times are no times of a tactile sensor [Hz]: the unit is another one."""
FASTEST_UNSAID, FASTEST_DATE, SLOWEST_UNSAID = 5000.0, 500.0, 1.0
"""Between these rates times need no unit [Hz]. Numbers that could be dates in days have a lower bound above."""
LATEST = 9.2e9
"""Times beyond cannot be held as 64 bits of nanoseconds [s]."""
NO_UNIT = {"", "unix", "epoch", "posix", "utc", "gmt", "local", "time", "timestamp", "a.u.", "-"}
"""Words in brackets behind a clock's name that are no unit (compared in lower case)."""


def times(table: SourceTable, clock: SourceClock, where: str) -> tuple[np.ndarray, str]:
    """Return each row's time and the zero of the clock.

    Args:
        table: The file.
        clock: ``time`` of the mapping.
        where: Place in the mapping, for errors.

    Returns:
        Times [ns], shape (rows,), int64, with the smallest int64 where a row has none; and "unix", "shared" or "own".

    Raises:
        FormatError: If the column or unit is wrong, or a Unix clock shows no Unix times.
    """
    column = clock.column
    if column is None:
        if clock.rate is None:
            raise FormatError(f"{where}: neither column nor rate", "one of them", "say where the times are")
        return _shifted(np.arange(table.rows) / clock.rate, clock), clock.zero or "own"
    if isinstance(column, list):
        if (parts := seconds_and_parts(table, column, where)) is not None:
            zero = "unix" if YEAR_2000 < np.median(parts) / 1e9 < YEAR_2100 else "shared"
            return _shifted_ns(parts, clock), clock.zero or zero
        table, column = _joined(table, column, where)
    name = single(table, column, f"{where}: column")
    if clock.rate is not None:  # the column counts rows, so that its restarts and lost rows are seen
        clock = replace(clock, zero=clock.zero or "own", unit=f"1/{clock.rate:.12g} s")
    unit = plain(unit_of(table, name, where, clock.unit) or clock_unit(name))
    values = table.column(name)
    if values.dtype == object and (clocked := times_of_day(values)) is not None:
        return _shifted(clocked, clock), clock.zero or "shared"
    if values.dtype == object or unit == "datetime":
        return _shifted_ns(_datetimes(values, clock.format, f"{where}: {name}"), clock), "unix"
    if unit in DAY_ZERO:
        return _of_days(values, unit, clock), clock.zero or "unix"
    if unit.lower() in NO_UNIT:
        if (clocked := digits_of_day(values)) is not None:
            return _shifted(clocked, clock), clock.zero or "shared"
        unit = _guessed(values)
        _refuse_unsaid(values, unit, f"{where}: {name}")
    scale = factor(unit, "s", f"{where}: {name}")
    if scale == DAY and (dated := _dated(values)):
        return _of_days(values, dated, clock), clock.zero or "unix"
    _refuse_other_unit(values, unit, scale, f"{where}: {name}")
    middle = float(np.nanmedian(values.astype(float))) * scale if len(values) else 0.0
    looks_unix = YEAR_2000 < middle < YEAR_2100
    if clock.zero == "unix" and not looks_unix:
        raise FormatError(
            f"{where}: {name} shows {middle:.6g} s in {unit}, no Unix time of this century",
            "seconds since 1970 in the unit that is given",
            "correct unit, or give zero: shared or zero: own",
        )
    zero = clock.zero or ("unix" if looks_unix else "shared")
    # Integers stay exact: Unix nanoseconds need 61 bits, a float64 has 53.
    if values.dtype.kind in "iu" and not clock.drift and scale < 1:
        return values.astype(np.int64) * round(scale * 1e9) + clock.offset_ns, zero
    return _shifted(values.astype(float) * scale, clock), zero


def future(time_ns: np.ndarray, where: str) -> tuple[str, ...]:
    """Return a doubt about Unix times [ns] that have not come yet, as LabVIEW's are, which count from 1904."""
    known = time_ns[time_ns != NEVER]
    middle = float(np.median(known)) / 1e9 if len(known) else 0.0
    now = datetime.now(UTC).timestamp()
    if middle < now + DAY:
        return ()
    year = datetime.fromtimestamp(min(middle, YEAR_2100), UTC).year
    zero = " LabVIEW counts from 1904: then give offset: -2082844800" if YEAR_2000 < middle - SINCE_1904 < now else ""
    return (f"{where}: its times lie in the future, in {year}: is their zero another?{zero}",)


NEVER = np.iinfo(np.int64).min
"""Time of a row that has none [ns]."""


def _shifted(seconds: np.ndarray, clock: SourceClock) -> np.ndarray:
    valid = np.isfinite(seconds)
    full_seconds = np.floor(np.where(valid, seconds, 0.0))
    part = np.where(valid, seconds, 0.0) - full_seconds
    # Whole seconds and the rest apart: a float64 resolves Unix nanoseconds to 240 ns only.
    result = full_seconds.astype(np.int64) * 1_000_000_000 + np.rint(part * 1e9).astype(np.int64)
    result[~valid] = NEVER
    return _shifted_ns(result, clock)


def _shifted_ns(time_ns: np.ndarray, clock: SourceClock) -> np.ndarray:
    valid = time_ns != NEVER
    result = time_ns.copy()
    if clock.drift:
        first = time_ns[valid].min() if valid.any() else 0
        stretched = (time_ns[valid] - first) / (1 + clock.drift * 1e-6)
        result[valid] = first + np.rint(stretched).astype(np.int64)
    result[valid] += clock.offset_ns
    return result


def _guessed(values: np.ndarray) -> str:
    """Return the unit that makes the values Unix times of this century, or s."""
    middle = float(np.nanmedian(values.astype(float))) if len(values) else 0.0
    return next((u for u in ("ns", "us", "ms") if YEAR_2000 < middle * FACTORS["s"][u] < YEAR_2100), "s")


def _of_days(values: np.ndarray, unit: str, clock: SourceClock) -> np.ndarray:
    """Return Unix times [ns] of days counted from one of `DAY_ZERO`."""
    return _shifted((values.astype(float) - DAY_ZERO[unit]) * DAY, clock)


def _dated(values: np.ndarray) -> str | None:
    """Return which clock of `DAY_ZERO` makes these days dates of this century; None if neither does."""
    middle = float(np.nanmedian(values.astype(float))) if len(values) else 0.0
    return next((n for n, zero in DAY_ZERO.items() if YEAR_2000 < (middle - zero) * DAY < YEAR_2100), None)


def _refuse_unsaid(values: np.ndarray, unit: str, where: str) -> None:
    """Refuse times without a unit that in seconds would come too fast or too slowly.

    Raises:
        FormatError: Saying which unit the mapping may give.
    """
    steps = np.diff(values.astype(float))
    steps = steps[np.isfinite(steps) & (steps > 0)]
    middle = float(np.nanmedian(values.astype(float))) if len(values) else 0.0
    if not len(steps) or unit != "s" or YEAR_2000 < middle < YEAR_2100:
        return  # the values themselves say that they are Unix times
    rate, dated = float(1 / (np.median(steps) * FACTORS["s"][unit])), _dated(values)
    if SLOWEST_UNSAID < rate <= (FASTEST_DATE if dated else FASTEST_UNSAID):
        return
    example = {"datenum": "MATLAB's datenum", "excel": "Excel's serial time"}.get(dated or "", "days, for example")
    fitting = [u for u in ("ms", "us", "ns", "min", "h", "d") if 2 < 1 / (np.median(steps) * FACTORS["s"][u]) <= 2000]
    if rate > SLOWEST_UNSAID and dated:
        fitting = [dated]
    step = f"the rows come at {rate:.3g} Hz" if rate > SLOWEST_UNSAID else f"a row comes every {1 / rate:.6g} s"
    raise FormatError(
        f"{where}: no unit is given, and read in {unit} {step}",
        f"{SLOWEST_UNSAID:g} to {FASTEST_UNSAID:g} Hz, or a unit"
        + (f" ({example} counts days)" if rate > SLOWEST_UNSAID and dated else ""),
        f"give unit: {' or '.join([*fitting, *([unit] if rate <= FASTEST else [])])} under time in the mapping; "
        "of a counter of rows give time: {rate: HZ}",
    )


def _refuse_other_unit(values: np.ndarray, unit: str, scale: float, where: str) -> None:
    """Refuse times that lie centuries away, without a place in 64 bits of nanoseconds, or that come too fast.

    Bursts are left alone: the mean rate counts.

    Raises:
        FormatError: Saying which unit would fit.
    """
    finite = values.astype(float)
    finite = finite[np.isfinite(finite)]
    latest, fitting = float(np.abs(finite).max(initial=0.0)) * scale, _guessed(values)
    if latest >= LATEST:
        raise FormatError(
            f"{where}: in {unit} its times reach {latest:.3g} s, {latest / 3.156e7:.3g} years",
            "times of this century, or of a clock that begins at zero",
            f"correct unit under time in the mapping, to {fitting} for example"
            if fitting != unit
            else "correct the column or its unit under time in the mapping",
        )
    span = float(np.ptp(finite)) * scale if len(finite) else 0.0
    if span > 0 and (len(finite) - 1) / span > FASTEST:
        raise FormatError(
            f"{where}: in {unit} the rows come at {(len(finite) - 1) / span:.3g} Hz",
            f"times at no more than {FASTEST:.0f} Hz",
            f"correct unit under time in the mapping, to {_dated(values) or 'd'} for example",
        )


DATES = (
    "%Y-%m-%d",
    "%Y/%m/%d",
    "%Y.%m.%d",
    "%Y%m%d",
    "%d.%m.%Y",
    "%d/%m/%Y",
    "%m/%d/%Y",
    "%d-%m-%Y",
    "%d-%b-%Y",
    "%d/%b/%Y",
    "%d %b %Y",
    "%d. %b %Y",
    "%b %d %Y",
    "%b %d, %Y",
    "%d.%m.%y",
    "%d/%m/%y",
    "%m/%d/%y",
)
WEEKDAYS = ("%a %b %d %H:%M:%S %Y", "%a %b %d %H:%M:%S.%f %Y")
CLOCKS = ("%H:%M:%S.%f", "%H:%M:%S", "%H:%M", "%I:%M:%S.%f %p", "%I:%M:%S %p", "%I:%M %p", "%H%M%S", "%H:%M:%S:%f")
"""Dates and times of day as instruments write them; the layout that fits all rows of a file decides."""
_ZONES = (
    "UTC 0 GMT 0 WET 0 WEST 1 CET 1 MEZ 1 CEST 2 MESZ 2 EET 2 EEST 3 MSK 3 JST 9 KST 9 "
    "EST -5 EDT -4 CDT -5 MST -7 MDT -6 PST -8 PDT -7"
).split()
ZONES: dict[str, int] = dict(zip(_ZONES[::2], map(int, _ZONES[1::2]), strict=True))
"""Zones that have one meaning -> hours ahead of UTC [h]. CST, IST and BST have several."""
ZONE = re.compile(rf"\s*\b({'|'.join(ZONES)})$")


def _joined(table: SourceTable, columns: list[str | int], where: str) -> tuple[SourceTable, str]:
    """Return the table with columns of dates and times of day joined into one, and that column."""
    names = [single(table, column, f"{where}: column") for column in columns]
    parts = [_as_texts(table.column(name)) for name in names]
    texts = [" ".join(row) if all(row) else None for row in zip(*parts, strict=True)]
    joined = " ".join(names)
    return replace(table, columns={**table.columns, joined: np.array(texts, dtype=object)}), joined


def seconds_and_parts(table: SourceTable, columns: Sequence[str | int], where: str) -> np.ndarray | None:
    """Return times [ns], shape (rows,), of whole seconds and their parts, as secs and nsecs; None of other columns."""
    names = [single(table, column, f"{where}: column") for column in columns]
    values = [table.column(name) for name in names]
    if len(names) != 2 or any(each.dtype == object or not np.isfinite(each).all() for each in values):
        return None
    units = [plain(table.units.get(name) or clock_unit(name) or clock_unit(name.rsplit(".", 1)[-1])) for name in names]
    size = FACTORS["s"].get(units[1], 1.0)
    seconds, parts = (np.rint(each).astype(np.int64) for each in values)
    is_whole = units[0] == "s" and size < 1 and (seconds == values[0]).all() and parts.min() >= 0
    if not is_whole or parts.max() * size >= 1 or (np.diff(parts) >= 0).all():
        return None
    return seconds * 1_000_000_000 + parts * round(size * 1e9)


def _as_texts(values: np.ndarray) -> list[str]:
    if values.dtype == object:
        return ["" if text is None else str(text).strip() for text in values.tolist()]
    return [f"{value:.15g}" if np.isfinite(value) else "" for value in values.astype(float)]


def _datetimes(values: np.ndarray, layout: str | None, where: str) -> np.ndarray:
    if values.dtype != object:
        return values.astype(np.int64)
    texts = ["" if text is None else in_english(str(text).strip()) for text in values.tolist()]
    moments = _iso(texts) if layout is None else None
    if moments is None:
        layout = layout or _layout(texts, where)
        texts = texts if "," in layout.partition("%S")[2] else [_pointed(text) for text in texts]
        moments = [_parsed(text, layout, f"{where}, row {row + 1}") for row, text in enumerate(texts)]
    result = np.full(len(values), NEVER, dtype=np.int64)
    for row, moment in enumerate(moments):
        if moment is not None:
            # A time without a zone counts as UTC: the zone of this computer would make an import depend on where it
            # runs.
            moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
            since = moment - datetime(1970, 1, 1, tzinfo=UTC)
            result[row] = (since.days * 86_400 + since.seconds) * 1_000_000_000 + since.microseconds * 1000
    return result


def _iso(texts: list[str]) -> list[datetime | None] | None:
    """Return times in ISO 8601; None if one has another layout."""
    try:
        zoned = (ZONE.sub(lambda match: f"{ZONES[match[1]]:+03d}:00", text.replace(",", ".")) for text in texts)
        return [datetime.fromisoformat(text) if text else None for text in zoned]
    except ValueError:
        return None


def _pointed(text: str) -> str:
    """Return a time with a point in place of a comma before the parts of a second."""
    return re.sub(r"(:\d{2}),(\d+)", r"\1.\2", text)


def _parsed(text: str, layout: str, where: str) -> datetime | None:
    if not text:
        return None
    try:
        return datetime.strptime(text, layout)
    except ValueError:
        raise FormatError(
            f"{where}: {text!r} is not written as {layout}",
            "one way of writing dates for all rows",
            "give format under time in the mapping, as Python's strptime has it, or correct the row",
        ) from None


def layouts_of(texts: list[str]) -> dict[str, list[datetime]]:
    """Return every layout of dates that fits texts, with a sample of the times that it makes of them."""
    # Spread over the file and up to its end: only a day above 12 distinguishes days from months.
    sample = [
        re.sub(r"(?<=\d)T(?=\d)", " ", in_english(_pointed(text)))
        for text in texts[:: max(len(texts) // 200, 1)] + texts[-1:]
    ]
    fitting = {}
    for layout in (*(f"{date} {clock}" for date in DATES for clock in CLOCKS), *WEEKDAYS):
        try:
            fitting[layout] = [datetime.strptime(text, layout) for text in sample]
        except ValueError:
            continue
    return fitting


def _layout(texts: list[str], where: str) -> str:
    """Return the only layout of dates that fits all texts.

    Raises:
        FormatError: If none fits, or days and months could change places.
    """
    filled = [text for text in texts if text]
    fitting = layouts_of(filled)
    different = {tuple(moments) for moments in fitting.values()}
    example = filled[0] if filled else ""
    if grouped := next((text for text in filled if THOUSANDS.fullmatch(text)), ""):
        raise FormatError(
            f"{where}: {grouped!r} is a number with a sign between its thousands",
            "numbers without one",
            "save it again without a sign between thousands",
        )
    if len(different) == 1:
        return next(iter(fitting))
    if not different:
        raise FormatError(
            f"{where}: {example!r} is no time that is known",
            "ISO 8601 (2026-01-31 12:00:00.250), or any other way of writing dates whose format is given",
            "give format under time in the mapping, for example '%d.%m.%Y %H:%M:%S.%f'",
        )
    raise FormatError(
        f"{where}: {example!r} can be read as {' or as '.join(sorted(fitting))}",
        "dates that can be read in one way",
        "give format under time in the mapping",
    )
