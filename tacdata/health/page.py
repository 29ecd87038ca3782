"""The health of a unit as one self-contained page of HTML."""

from __future__ import annotations

import base64
from functools import cache
from io import BytesIO
from typing import Any

from tacdata.health import picture
from tacdata.health.advice import CALLED, FIRST, NOTHING, advice, named, told
from tacdata.health.comparison import VisitComparison
from tacdata.health.document import not_assessed, remarks, summary
from tacdata.health.history import History

FEWEST_ROWS = 1
"""Channels of a quantity that the table shows: the one that changed most, and all beyond their tolerance."""


def page(history: History) -> str:
    """Return the page."""
    stream = BytesIO()
    picture.draw(history, stream)
    advised = advice(history)
    return _template().render(
        unit=history.last.sensor.name,
        latest=history.last,
        visits=history.visits,
        began=history.last.started[:16].replace("T", " at "),
        advised=[(a.do, named(a.channels) if a.channels else "", a.why) for a in advised],
        well=advised[0].do in (NOTHING, FIRST),
        tiles=summary(history),
        picture=base64.b64encode(stream.getvalue()).decode("ascii"),
        tables=[(history.visits[c.against].name, len(c.pairs), _rows(c)) for c in history.comparisons[-1]],
        lines=[*not_assessed(history), *remarks(history)],
    )


def _rows(comparison: VisitComparison) -> list[tuple[str, str, str, str, bool]]:
    """Return the table of a comparison: quantity, value with interval, tolerance, corrected p-value, changed."""
    changes = []
    for quantity in CALLED:
        of = sorted((c for c in comparison.changes if c.quantity == quantity), key=lambda c: -abs(c.value))
        changes += [c for k, c in enumerate(of) if c.changed or k < FEWEST_ROWS]
    rows = []
    for c in changes:
        words = CALLED[c.quantity] + ("" if c.channel is None else f", channel {c.channel}")
        share = 100 if c.unit == "1" and c.quantity != "noise" else 1
        unit = {"noise": "times", "loop": "points"}.get(c.quantity, "%" if share == 100 else c.unit)
        p = "< 0.001" if c.corrected < 0.001 else f"{c.corrected:.3f}"
        rows.append((words, told(c), f"{share * c.tolerance:.3g} {unit}", p, c.changed))
    return rows


@cache
def _template() -> Any:
    from jinja2 import Environment, PackageLoader

    sources = PackageLoader("tacdata.health", ".")
    return Environment(loader=sources, autoescape=True, trim_blocks=True, lstrip_blocks=True).get_template(
        "page.html.j2"
    )
