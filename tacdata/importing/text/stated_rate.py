"""The rate and the size of a count that a text states above its rows."""

import re

import numpy as np

from tacdata.importing.units import factor

STATED_RATE = re.compile(
    r"(?:sampl\w*|abtast\w*|acquisition|scan)[ _-]*(?:rate|freq\w*)?[^\d\n]{0,20}?"
    r"(\d+(?:\.\d+)?)\s*(k?)(?:hz|s/s|sps|1/s)",
    re.IGNORECASE,
)
"""How a file states its rate above its rows."""
STATED_STEP = re.compile(
    r'^\W*(?:Delta_X|sampl\w*[ _](?:interval|period))"?[\t,;:=]\s*"?(\d*[.,]?\d+(?:e[-+]?\d+)?)'
    r"(?:[\t ,;\"]*([m\u00b5un]?s(?:ec)?)\b)?",
    re.MULTILINE | re.IGNORECASE,
)
"""How LabVIEW and oscilloscopes state the time between two rows [s]."""
RATE_ALONE = re.compile(
    r"(?:sampl\w*|abtast\w*|acquisition|scan)[ _-]*(?:rate|freq\w*)\W{0,4}(?:(k?)(?:hz|s/s|sps|1/s)\W{1,4})?"
    r"(\d+(?:\.\d+)?)(?=\s*(?:$|[,;}\]\t\"]))",
    re.IGNORECASE | re.MULTILINE,
)
"""A rate with its unit before the number, or without one."""
COUNTS = r"(?:counts?|steps?|ticks?|pulses|inc(?:rement)?s?)"
STATED_COUNTS = re.compile(
    rf"(\d+(?:\.\d+)?)\s*{COUNTS}\s*(?:/|per )\s*mm\b|{COUNTS}\s*(?:/|per )\s*mm\b\W{{1,4}}(\d+(?:\.\d+)?)", re.I
)
"""How a file states how many counts of its encoder are a millimetre."""
COUNTED = re.compile(
    r"(enc(oder)?|steps?|pulses|(stage|motor|present|z)?_?pos(ition)?|z)(_?(count|step|tick)s?)?", re.I
)
"""Names of positions that a motor or an encoder may count."""


def stated_counts(text: str, skip: int, columns: dict[str, np.ndarray]) -> dict[str, str]:
    """Return the unit, as 1/800 mm, of positions in whole numbers, if the first lines of a text state their size."""
    match = STATED_COUNTS.search("\n".join(text.split("\n", skip)[:skip]))
    names = [name for name in columns if match and COUNTED.fullmatch(name) and columns[name].dtype != object]
    return {n: f"1/{match[1] or match[2]} mm" for n in names if match and not np.nansum(columns[n] % 1)}


def stated_rate(text: str, skip: int) -> float:
    """Return the rate that the first lines of a text state [Hz]; 0 if they state none."""
    head = "\n".join(text.split("\n", skip)[:skip])
    match = STATED_RATE.search(head)
    if match:
        return float(match[1]) * (1000.0 if match[2] else 1.0)
    if match := RATE_ALONE.search(head):
        return float(match[2]) * (1000.0 if match[1] else 1.0)
    match = STATED_STEP.search(head)
    step = float(match[1].replace(",", ".")) * factor(match[2] or "s", "s", "") if match else 0.0
    return 1 / step if step > 0 else 0.0
