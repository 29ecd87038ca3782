"""The rate that a text states above its rows."""

import re

STATED_RATE = re.compile(
    r"(?:sampl\w*|abtast\w*|acquisition|scan)[ _-]*(?:rate|freq\w*)?[^\d\n]{0,20}?"
    r"(\d+(?:\.\d+)?)\s*(k?)(?:hz|s/s|sps|1/s)",
    re.IGNORECASE,
)
"""How a file states its rate above its rows."""
STATED_STEP = re.compile(r"^Delta_X\t(\d*[.,]?\d+(?:[eE][-+]?\d+)?)", re.MULTILINE)
"""How LabVIEW states the time between two rows [s]."""
RATE_ALONE = re.compile(
    r"(?:sampl\w*|abtast\w*|acquisition|scan)[ _-]*(?:rate|freq\w*)\W{0,4}(?:(k?)(?:hz|s/s|sps|1/s)\W{1,4})?"
    r"(\d+(?:\.\d+)?)(?=\s*(?:$|[,;}\]\t\"]))",
    re.IGNORECASE | re.MULTILINE,
)
"""A rate with its unit before the number, or without one."""


def stated_rate(text: str, skip: int) -> float:
    """Return the rate that the first lines of a text state [Hz]; 0 if they state none."""
    head = "\n".join(text.split("\n", skip)[:skip])
    match = STATED_RATE.search(head)
    if match:
        return float(match[1]) * (1000.0 if match[2] else 1.0)
    if match := RATE_ALONE.search(head):
        return float(match[2]) * (1000.0 if match[1] else 1.0)
    step = STATED_STEP.search(head)
    return 1 / float(step[1].replace(",", ".")) if step and float(step[1].replace(",", ".")) > 0 else 0.0
