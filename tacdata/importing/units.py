"""Units of foreign files and their conversion to mm, N, s. Taxel readings keep their unit."""

import re

from tacdata.errors import FormatError

GRAVITY = 9.80665
"""Standard gravity [m/s^2]: a load cell in grams was calibrated with weights (CGPM 1901)."""
FACTORS: dict[str, dict[str, float]] = {
    "mm": {"m": 1e3, "dm": 1e2, "cm": 10.0, "mm": 1.0, "um": 1e-3, "nm": 1e-6, "in": 25.4, "mil": 0.0254, "ft": 304.8},
    "N": {
        "N": 1.0,
        "mN": 1e-3,
        "uN": 1e-6,
        "kN": 1e3,
        "cN": 1e-2,
        "g": GRAVITY * 1e-3,
        "gf": GRAVITY * 1e-3,
        "kg": GRAVITY,
        "kgf": GRAVITY,
        "lbf": 4.4482216152605,
        "lb": 4.4482216152605,
        "ozf": 0.27801385095378125,
    },
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86_400.0},
    "mm/s": {"mm/s": 1.0, "mm/min": 1 / 60, "um/s": 1e-3, "m/s": 1e3, "cm/s": 10.0},
    "deg": {"deg": 1.0, "rad": 57.29577951308232},
}
"""Our unit -> the units that can be converted to it, and the factor."""
SPELLINGS = {
    "s": "sec secs second seconds sek sekunde sekunden seconde secondes segundo segundos secondo secondi sn \u79d2",
    "ms": "millisekunde millisekunden milisegundos millisecondes \u6beb\u79d2 msec "
    "msecs millis millisec millisecs millisecond milliseconds",
    "us": "usec usecs micros microsec microsecs microsecond microseconds",
    "ns": "nsec nsecs nanos nanosec nanosecs nanosecond nanoseconds",
    "min": "mins minute minutes",
    "h": "hr hrs hour hours",
    "d": "day days",
    "um": "mikrometer mikrometern mikron micrometro \u5fae\u7c73 micron microns",
    "mm": "millim\u00e8tre millim\u00e8tres mil\u00edmetros milimetros millimetri \u6beb\u7c73",
    "cm": "zentimeter \u5398\u7c73",
    "in": "inch inches",
    "mil": "mils thou",
    "ft": "foot feet",
    "N": "newton newtons newtonios \u725b",
    "mN": "millinewton millinewtons",
    "kN": "kilonewton kilonewtons",
    "uN": "micronewton micronewtons",
    "g": "gram grams",
    "kg": "kilogram kilograms",
    "kgf": "kp",
    "lb": "lbs pound pounds",
    "ozf": "oz",
    "deg": "degree degrees",
    "rad": "radian radians",
    "V": "volt volts",
    "mm/s": "mm/sec",
    "m/s": "m/sec",
}
"""Unit -> its other spellings, in lower case."""
METRES = {"met": "m", "millimet": "mm", "micromet": "um", "nanomet": "nm", "centimet": "cm"}
SPELLED = {word: unit for unit, words in SPELLINGS.items() for word in words.split()}
SPELLED |= {start + end: unit for start, unit in METRES.items() for end in ("er", "ers", "ern", "re", "res")}
"""Other spellings, in lower case -> the unit."""
SCALE = re.compile(
    r"[x\u00d7*]?\s*(?:10\^?([-+]\d+)|(1/)?(\d+(?:\.\d+)?(?:[eE][-+]?\d+)?))\s*[*x\u00b7\u00d7]?\s*([^\d\s].*)"
)
"""A number before a unit, as a counter's step has one: "10 ms", "0.1 um", "1/20 s", "10^-3 s"."""
WIDE_BRACKETS = str.maketrans("\uff08\uff09\uff3b\uff3d\u3010\u3011\uff5b\uff5d", "()[][]{}")
"""Brackets of Chinese and Japanese programs, and ours."""
WORDS = ("IN", "MIN")
"""Endings of names that are no unit, as of "V_IN" and "T_MIN"."""
NAMES = ("d", "ft")
"""Endings that are no unit without brackets: a depth or distance, a force-torque sensor."""
CLOCKS = r"(time|t|zeit|elapsed|timestamp|clock)"
"""Names behind which a capital S is seconds, and no siemens."""
BRACKETED = r"\s*(?:\[([^\[\]]*)\]|\(([^()]*)\)|\{([^{}]*)\}|<([^<>]*)>)\s*"
OTHERS = set("pf ff nf v mv uv count counts lsb adc ut mt gauss kpa pa mpa degc c k ohm kohm a ma hz 1 raw %".split())
"""Units that are recognized behind a column's name but not converted."""


PREFIXES = "fpnumkMG"
"""Letters before a unit that make it larger or smaller."""


INCH = dict.fromkeys(('"', "\u2033", "\u201d", "''"), "in")
"""Signs of inches."""


def plain(unit: str) -> str:
    """Return a unit's name in ASCII, as the tables have it."""
    name = unit.strip().removeprefix("\u00c2")  # UTF-8 that was read as Latin-1
    name = INCH.get(name, name).replace("\u00b5", "u").replace("\u03bc", "u").replace("\u00b0", "deg").rstrip(".")
    return SPELLED.get(name.lower(), name)


def factor(unit: str, target: str, origin: str) -> float:
    """Return the factor from ``unit`` to ``target``.

    Raises:
        FormatError: If the unit is none of those that can be converted to it.
    """
    ratio = _factor(unit, target)
    if ratio is None:
        raise FormatError(f"{origin}: unit {unit!r}", ", ".join(FACTORS[target]), "correct the unit in the mapping")
    return ratio


def _factor(unit: str, target: str) -> float | None:
    table, name = FACTORS[target], plain(unit)
    if name in table:
        return table[name]
    # Capitals tell mN from MN and nothing else.
    if target != "N" and (value := {key.lower(): value for key, value in table.items()}.get(name.lower())):
        return value
    if match := SCALE.fullmatch(name):
        power, divisor, number, remainder = match.groups()
        steps = 10.0 ** int(power) if power else 1 / float(number) if divisor and float(number) else float(number)
        inner = _factor(remainder, target)
        return None if inner is None else steps * inner
    return None


def prefixed(first: str, second: str) -> bool:
    """Return whether two units differ by their prefix alone, as pF and nF, or mV and V."""
    bare = {name[1:] if len(name) > 1 and name[0] in PREFIXES else name for name in (plain(first), plain(second))}
    return plain(first) != plain(second) and len(bare) == 1


def quantity_of(unit: str) -> str | None:
    """Return our unit that ``unit`` converts to, or None. "MM" is mm, and "1/800 mm" too."""
    unit = match[4] if (match := SCALE.fullmatch(unit)) else unit
    spelled = {plain(unit), plain(unit.lower()) if len(unit) > 1 and unit.isupper() and unit not in WORDS else ""}
    return next((ours for ours, table in FACTORS.items() if spelled & table.keys()), None)


def split_unit(name: str) -> tuple[str, str]:
    """Return a column's name without its unit, and the unit.

    As in "Fz [N]", "Fz (N)", "Fz {N}", "Fz / N", "fz_N", "Fz, N", "t [ms] since start" or "timeMs".
    """
    name = name.translate(WIDE_BRACKETS)
    if match := re.fullmatch("(.*?)" + BRACKETED, name):
        return match[1].strip(), next((text for text in match.groups()[1:] if text), "").strip()
    for match in re.finditer(BRACKETED, name):
        unit = next((text for text in match.groups() if text), "").strip()
        if quantity_of(unit):
            return f"{name[: match.start()]} {name[match.end() :]}".strip(), unit
    if match := re.fullmatch(r"(.+?)\s+(?:in|en)\s+(\S+)", name):
        return (match[1], match[2]) if _is_unit(match[2]) else (name, "")
    if match := re.fullmatch(r"(.+?)\s*[/_ ,;|]\s*([A-Za-z\u00b5\u03bc%]+)", name):
        is_known = _is_unit(match[2])
        if match[2] == "S" and re.fullmatch(CLOCKS, match[1].strip().lower()):
            return match[1].strip(), "s"
        return (match[1].strip(), match[2]) if is_known and match[2].lower() not in NAMES else (name, "")
    if match := re.fullmatch(r"(.+?)\s*[-.:]\s*([A-Za-z\u00b5]{2,})", name) or re.fullmatch(
        r"(.*[a-z\d])((?:Ms|Us|Ns|Mm|Um|Sec|Msec|Usec|Millis|Micros|Nanos|Seconds))", name
    ):
        hump = name[match.start(2) - 1].isalnum()
        unit = plain(match[2].lower() if hump or match[2].lower() in SPELLED else match[2])
        # "min" and "in" behind a point are rather a minimum and an input.
        return (match[1].strip(), unit) if quantity_of(unit) and unit not in ("min", "in", *NAMES) else (name, "")
    return name, ""


def _is_unit(text: str) -> bool:
    """Return whether a word behind a name is a unit; a single letter of electricity is rather a name."""
    return bool(quantity_of(text)) or plain(text).lower() in OTHERS - {"c", "k", "a", "v", "1"}


def clock_unit(name: str) -> str:
    """Return the unit of time at any position in a clock's name: "millis", "ms_rel", "time_10ms"; "" if none."""
    if _factor(bare := name.strip().removesuffix("()"), "s") and len(bare) > 1:
        return bare
    words = re.findall(r"\d+(?:\.\d+)?[A-Za-z]+|[A-Za-z]+", re.sub(r"([a-z])([A-Z])", r"\1 \2", name))
    matches = [word for word in words if len(word) > 1 and word.lower() != "min" and _factor(word.lower(), "s")]
    return matches[0] if len(matches) == 1 else ""
