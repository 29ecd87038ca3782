"""The health of a unit as one self-contained page of HTML."""

from shlex import quote

import numpy as np

from tacdata import provenance
from tacdata.health.advice import CALLED, FIRST, NOTHING, Advice, advice, named, told
from tacdata.health.comparison import VisitComparison
from tacdata.health.document import not_assessed, remarks, summary
from tacdata.health.figures import figures
from tacdata.health.history import History
from tacdata.pages import Cell, HtmlPage, Items, PageHeader, Paragraph, Table, Tiles

FEWEST_ROWS = 1
"""Channels of a quantity that the table shows: the one that changed most, and all beyond their tolerance."""


def page(history: History) -> str:
    """Return the page."""
    made = HtmlPage(_header(history))
    made.add("Latest visit", Tiles([(words.split(" (")[0], _named(name, words)) for name, words in summary(history)]))
    made.add("Over the visits", *figures(history))
    for c in history.comparisons[-1]:
        words = (
            f"{len(c.pairs)} presses compared. Of each quantity the channel that changed most, and all beyond their "
            "tolerance."
        )
        heads = ("quantity", "change (95 % interval)", "tolerance", "p, corrected by Holm")
        made.add(f"Compared with {history.visits[c.against].name}", Paragraph(words, note=True), Table(heads, _rows(c)))
    made.add("Visits", _visits(history))
    if lines := [*not_assessed(history), *remarks(history)]:
        made.add("Of these sessions", Items(lines))
    return made.text


def _header(history: History) -> PageHeader:
    advised, last = advice(history), history.last
    first, *others = (_sentence(one) for one in advised)
    count = len(history.visits)
    well = advised[0].do in (NOTHING, FIRST)
    folders = " ".join(quote(str(visit.session.folder)) for visit in history.visits)
    return PageHeader(
        "Health of a unit",
        first,
        of=f"{last.sensor.name} at {last.name}, visit {count} of {count}, {len(last.entries)} presses used",
        made=last.started[:16].replace("T", " "),
        version=provenance.code_version(),
        status=advised[0].spoken,
        tone="good" if well else "bad",
        lines=others,
        next=[
            "the plan of the next visit: `tacdata plan health --out health.yaml`",
            f"then compare it with these, its folder in place of NEXT: `tacdata health {folders} NEXT`",
        ],
    )


def _sentence(one: Advice) -> str:
    channels = f", {named(one.channels)}" if one.channels else ""
    return f"{one.spoken.capitalize()}{channels}: {one.why}."


def _named(name: str, words: str) -> str:
    """Return a tile's name, with the interval of its value."""
    return f"{name} ({words.split(' (', 1)[1]}" if " (" in words else name


def _visits(history: History) -> Table:
    """Return the unit's history, the latest visit first."""
    rows = []
    for number in reversed(range(len(history.visits))):
        visit, wiring = history.visits[number], history.wiring_at(number)
        first = history.beside_first(number)
        gain = 100 * first.gains.common.value if first and first.gains else None
        dead = ", ".join(map(str, wiring.dead)) or "none"
        noise = float(np.median([value.value for value in visit.noise.values()]))
        started = visit.started[:16].replace("T", " ")
        rows.append((visit.name, started, len(visit.entries), gain, noise, 100 * visit.loop.value, dead))
    unit = history.last.unit
    heads = ("session", "began", "presses", "gain of the first [%]", f"noise [{unit}]", "loop [%]", "dead channels")
    return Table(heads, rows)


def _rows(comparison: VisitComparison) -> list[list[Cell]]:
    """Return the table of a comparison: quantity, value with interval, tolerance, corrected p-value."""
    changes = []
    for quantity in CALLED:
        of = sorted((c for c in comparison.changes if c.quantity == quantity), key=lambda c: -abs(c.value))
        changes += [c for k, c in enumerate(of) if c.changed or k < FEWEST_ROWS]
    rows = []
    for c in changes:
        words = CALLED[c.quantity] + ("" if c.channel is None else f", channel {c.channel}")
        share = 100 if c.unit == "1" and c.quantity != "noise" else 1
        unit = {"noise": "times", "loop": "points"}.get(c.quantity, "%" if share == 100 else c.unit)
        p = "< 0.001" if c.corrected < 0.001 else c.corrected
        cells = (words, told(c), f"{share * c.tolerance:.3g} {unit}", p)
        rows.append([Cell(value, bad=c.changed) for value in cells])
    return rows
