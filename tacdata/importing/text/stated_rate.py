"""The rate and the size of a count that a text states above its rows."""

import re

import numpy as np

from tacdata.importing.units import factor, quantity_of

STATED_RATE = re.compile(
    r"(?:sampl\w*|abtast\w*|acquisition|scan)[ _-]*(?:rate|freq\w*)?[^\d\n]{0,20}?"
    r"(\d+(?:\.\d+)?)\s*(k?)(?:hz|s/s|sps|1/s)",
    re.IGNORECASE,
)
"""How a file states its rate above its rows."""
STATED_STEP = re.compile(
    r'^\W*(?:Delta_X|(?:sampl|record)\w*[ _](?:interval|period|cycle))"?\s*(?:[\[(]([m\u00b5un]?s)[\])])?"?'
    r'[\t,;:=]\s*"?(\d*[.,]?\d+(?:e[-+]?\d+)?)(?:[\t ,;"]*([m\u00b5un]?s(?:ec)?)\b)?',
    re.MULTILINE | re.IGNORECASE,
)
"""How LabVIEW and oscilloscopes state the time between two rows [s]."""
RATE_ALONE = re.compile(
    r"(?:(?:sampl\w*|abtast\w*|acquisition|scan)[ _-]*(?:rate|freq[a-z]*)|\bfs\b)[\W_]{0,4}"
    r"(?:(k?)(?:hz|s/s|sps|1/s)\W{1,4})?"
    r"(\d+(?:\.\d+)?)(?=\s*(?:$|[,;}\]\t\"]))",
    re.IGNORECASE | re.MULTILINE,
)
"""A rate with its unit before the number, or without one."""
COUNTS = r"(?:counts?|steps?|ticks?|pulses|inc(?:rement)?s?)"
PER = rf"{COUNTS}\s*(?:/|per )\s*(mm|N|newton|force)\b"
STATED_COUNTS = re.compile(rf"(\d+(?:\.\d+)?)\s*{PER}|{PER}\W{{1,4}}(\d+(?:\.\d+)?)(?:\s*\(?(N|lbf|kgf))?", re.I)
"""How a file states how many counts are a millimetre or a newton."""
STATED_SIZE = re.compile(
    rf"(\d+(?:\.\d+)?)\s*([mu\u00b5]m|m?N)\s*(?:/|per )\s*{COUNTS}"
    r"|\b(?:count|tick|pulse|lsb)\s*=\s*(\d+(?:\.\d+)?)\s*([mu\u00b5]m|m?N|[mu\u00b5n]s)\b",
    re.I,
)
"""How a file states the size of a count."""
COUNTED = {
    "mm": re.compile(
        r"(enc(oder)?|steps?|pulses|(stage|motor|present|z)?_?pos(ition)?|z)(_?(count|step|tick)s?)?", re.I
    ),
    "N": re.compile(r"f_?[xyzn]?|(force|load)(_?[xyzn])?", re.I),
    "s": re.compile(r"(time|clock)?_?ticks?|t(ime)?(_?stamp)?", re.I),
}
"""Our unit -> names of columns that a motor, an encoder, a converter or a clock may count."""


def stated_counts(text: str, skip: int, columns: dict[str, np.ndarray]) -> dict[str, str]:
    """Return the unit, as 1/800 mm, of whole numbers, if the first lines of a text state the size of a count."""
    head = "\n".join(text.split("\n", skip)[:skip])
    sizes = [f"{match[1] or match[3]} {match[2] or match[4]}" for match in STATED_SIZE.finditer(head)]
    for match in STATED_COUNTS.finditer(head):
        is_length = (match[2] or match[3]).lower() == "mm"
        sizes.append(f"1/{match[1] or match[4]} {'mm' if is_length else match[5] or 'N'}")
    units: dict[str, str] = {}
    for size in sizes:
        pattern = COUNTED[quantity_of(size) or ""]
        names = [name for name, values in columns.items() if pattern.fullmatch(name) and values.dtype != object]
        units |= {name: size for name in names if not np.nansum(columns[name] % 1)}
    return units


def stated_rate(text: str, skip: int) -> float:
    """Return the rate that the first lines of a text state [Hz]; 0 if they state none."""
    head = "\n".join(text.split("\n", skip)[:skip])
    match = STATED_RATE.search(head)
    if match:
        return float(match[1]) * (1000.0 if match[2] else 1.0)
    if match := RATE_ALONE.search(head):
        return float(match[2]) * (1000.0 if match[1] else 1.0)
    match = STATED_STEP.search(head)
    step = float(match[2].replace(",", ".")) * factor(match[1] or match[3] or "s", "s", "") if match else 0.0
    return 1 / step if step > 0 else 0.0
