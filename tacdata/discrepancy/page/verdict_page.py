"""The verdict as one page of HTML: findings, their confidence, and the next step."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.discrepancy.heading import sentence, sizes
from tacdata.discrepancy.page.heat_map import heat_map
from tacdata.discrepancy.page.press_curves import PressCurves, largest_changes
from tacdata.discrepancy.plain_number import plain_number
from tacdata.discrepancy.verdict.residual_table import Residuals
from tacdata.discrepancy.verdict.text import LEAST_CLOSED, between_specimens, unsaid
from tacdata.effects import load
from tacdata.pages import Band, Cell, HtmlPage, Items, PageHeader, Plot, Series, Shares, Slider, Table, Tiles

MOST_RIVALS = 4
"""Rivals of an effect that have a line, the nearest."""
REST = "left: a press's own pose and gain, and what has no name"
PARTED = ("phase", "depth", "rate")
"""Kinds of slices shown before and after, next to the map."""
TAKEN_OUT = "each press's own pose and gain taken out"
FILLED = 0.5
"""Share of its fields in which a map has readings enough, at least."""


def verdict_page(verdict: dict[str, Any], residuals: Residuals) -> str:
    """Return the page.

    Args:
        verdict: `schemas/verdict.schema.json`.
        residuals: Readings and the model's predictions.
    """
    page = HtmlPage(_header(verdict))
    page.add("Size of the gap", Tiles(_tiles(verdict)))
    page.add("Presses, measured and predicted", _presses(verdict, residuals))
    page.add("The gap on sealed presses", _shares(verdict))
    page.add(
        "Where the gap lives" if verdict["gate"]["gap"] else "Where the residual is largest",
        *_where(verdict, residuals),
    )
    for title, lines in (
        ("In which order effects were added, and what each explains beyond the others", _path(verdict)),
        ("Why not the others", _rivals(verdict)),
        ("Of these recordings", unsaid(verdict)),
    ):
        page.add(title, _items(lines))
    for title, lines in _folded(verdict):
        page.add(title, _items(lines), folded=True)
    return page.text


def _items(lines: Sequence[str]) -> Items | None:
    return Items(lines) if lines else None


def _header(verdict: dict[str, Any]) -> PageHeader:
    heading, stamp = verdict.get("heading", {}), verdict.get("provenance", {})
    first, further = sentence(verdict["why"])
    recorded = f"recorded {heading['recorded']}" if heading.get("recorded") else ""
    judged = f"judged {stamp['made_at'][:10]}" if "made_at" in stamp else ""
    return PageHeader(
        "Verdict",
        first,
        of=", ".join(Path(path).name for path in heading.get("recordings", ())),
        made=", ".join(words for words in (recorded, judged) if words),
        version=stamp.get("code_version", ""),
        status=verdict["status"],
        tone="good" if verdict["status"] == "named" else "",
        lines=[*sizes(verdict), *([further] if further else [])],
        next=verdict["next"],
    )


def _tiles(verdict: dict[str, Any]) -> list[tuple[str, str]]:
    """Return figures in large print, each a value and its name."""
    data, sealed = verdict["data"], verdict["sealed"]
    tiles = [(str(data["episodes"]), "presses"), (str(data["channels"]), "channels")]
    for e in verdict["effects"]:
        if e["status"] == "named" and e["confidence"] is not None:
            tiles.append((f"{100 * e['confidence']:.0f} %", f"sure of {load(e['effect']).spoken}"))
    if sealed["episodes"] and verdict["effects"]:
        words = f"residual of {sealed['episodes']} sealed presses, mean square over the noise (1 is noise alone)"
        tiles.append((f"{plain_number(sealed['before'], 3)} → {plain_number(sealed['after'], 3)}", words))
        if sealed["certain"] and sealed["closed"] >= LEAST_CLOSED:
            low, high = sealed["interval"]
            spread = f"of their gap closed (90 %: {100 * low:.0f} to {100 * high:.0f} %)"
            tiles.append((f"{100 * sealed['closed']:.0f} %", spread))
    return tiles


def _presses(verdict: dict[str, Any], residuals: Residuals) -> Slider | None:
    """Return the presses under one slider: reading, residual, and what lies beyond the model over depth."""
    presses = largest_changes(residuals)
    if not presses:
        return None
    added = bool(verdict["effects"]) and not between_specimens(verdict)
    unit = verdict.get("heading", {}).get("unit", "") or "the stream's unit"
    kind = "sealed press" if residuals.sealed else "press"
    panels = zip(*(_panels(press, unit, added) for press in presses), strict=True)
    return Slider(f"{kind}, largest change first", [f"{p.name}, {p.stream}" for p in presses], list(panels))


def _panels(p: PressCurves, unit: str, added: bool) -> tuple[Plot, Plot, Plot]:
    level, noise = (
        float(np.nanmedian(p.measured[:5])),
        Band(-2 * p.noise, 2 * p.noise, "noise, two standard deviations"),
    )
    reading = [
        Series("measured", p.measured - level, "ink", width=3.0),
        Series("model as it was", p.before - level, "vermilion"),
    ]
    residual = [Series("model as it was", p.measured - p.before, "vermilion")]
    beyond = [Series("measured", p.measured - p.before, "ink", x=p.depth)]
    if added:
        reading.append(Series("model with the effects", p.after - level, "blue"))
        residual.append(Series("model with the effects", p.measured - p.after, "blue"))
        beyond.append(Series("model with the effects", p.after - p.before, "blue", x=p.depth))
    # On the scale of the readings a loop is too thin to be seen.
    return (
        Plot("reading above idle", "time [s]", f"reading [{unit}]", reading, p.time, link="press"),
        Plot(
            "residual: measured less model", "time [s]", f"residual [{unit}]", residual, p.time, [noise], link="press"
        ),
        Plot("beyond the model as it was, over depth", "depth [mm]", f"difference [{unit}]", beyond, bands=[noise]),
    )


def _shares(verdict: dict[str, Any]) -> Shares | None:
    """Return the sealed gap as one bar: each name, the remainder."""
    sealed = verdict["sealed"]
    if not sealed["episodes"] or not verdict["effects"] or not sealed["certain"] or sealed["closed"] <= 0:
        return None
    named = [(load(name).spoken, share) for name, share in sealed["shares"].items() if share > 0]
    return Shares([*named, (REST, max(1 - sealed["closed"], 0.0))], REST)


def _where(verdict: dict[str, Any], residuals: Residuals) -> list[Any]:
    heat = heat_map(residuals)
    added = bool(verdict["effects"]) and not between_specimens(verdict)
    parts = [part for part in verdict["slices"] if part["by"] in PARTED] if added else []
    title = "mean square over the noise"
    blocks: list[Any] = []
    sentences = verdict["located"]
    if heat.rows and (not parts or np.isfinite(heat.before).mean() >= FILLED):
        title += ", before; each press's own pose and gain left in" if parts else ""
        blocks.append(_heated(title, ("phase", *heat.columns), heat.rows, heat.before))
    if parts:
        # Under poses and gains that effects do not explain, the map would hardly change.
        square = np.array([[part["before"], part["after"]] for part in parts])
        names = [part["name"] for part in parts]
        heads = (", ".join(PARTED), "before", "with the effects")
        blocks.append(_heated(f"mean square over the noise, {TAKEN_OUT}", heads, names, square))
        sentences = [words for words in sentences if words.split(":")[0] not in PARTED]
    located_after = verdict.get("located_after", ())
    unnamed = [f"without a name yet: {words}" for words in located_after if list(located_after) != verdict["located"]]
    caption = "the map holds each press's own pose and gain, too; these mean squares over the noise leave that out"
    located = (*(() if parts else (caption,)), *sentences) if sentences else ()
    lines = [*located, *unnamed]
    return [*blocks, *([Items(lines)] if lines else [])]


def _heated(title: str, heads: Sequence[str], names: Sequence[str], squares: np.ndarray) -> Table:
    """Return mean squares over the noise as a table; its largest value has the deepest colour."""
    largest = max(float(np.nanmax(squares, initial=1.0)), 2.0)
    rows = [
        [name, *(_square(float(value), largest) for value in row)] for name, row in zip(names, squares, strict=True)
    ]
    return Table(heads, rows, title)


def _square(value: float, largest: float) -> Cell:
    if not np.isfinite(value):
        return Cell(None)
    return Cell(plain_number(value, 3), heat=float(np.clip(np.log(max(value, 1.0)) / np.log(largest), 0, 1)))


def _path(verdict: dict[str, Any]) -> list[str]:
    lines = []
    for step in verdict["path"]:
        title, share = load(step["effect"]).title, step["share"]
        outcome = "dropped, or replaced by another form" if share is None else f"{100 * share:.0f} %"
        lines.append(f"{title}: {outcome}")
    return lines


def _rivals(verdict: dict[str, Any]) -> list[str]:
    """Return one line a rival: why it is not the name, or why it may be."""
    lines = []
    for e in verdict["effects"]:
        title, near, margin_of = load(e["effect"]).spoken, set(e["alternatives"]), {}
        for name, by in sorted(e["margins"].items(), key=lambda item: item[1]):
            margin_of.setdefault(load(name).called, by)
        for mechanism, by in list(margin_of.items())[:MOST_RIVALS]:
            rival = load(mechanism).spoken
            if mechanism in e.get("unphysical", ()):
                lines.append(f"not {rival}: it would need an unphysical size")
            elif mechanism in near:
                form = ", but another form of it may not" if by > 0 else ""
                lines.append(f"{rival} may stand in for {title}: {_apart(by)}{form}")
            else:
                lines.append(f"not {rival}: {_apart(by)} than {title}")
    return list(dict.fromkeys(lines))


def _apart(by: float) -> str:
    if by > 0:
        return f"it explains the presses worse by {by:.1f} standard errors"
    return f"it explains the presses better by {-by:.1f} standard errors" if by < 0 else "it explains them as well"


def _folded(verdict: dict[str, Any]) -> list[tuple[str, list[str]]]:
    """Return the effects that cannot be judged, by reason, and those known and not modelled."""
    reasons: dict[str, list[str]] = {}
    for name, reason in verdict["unjudgeable"].items():
        reasons.setdefault(reason, []).append(load(name).spoken)
    lines = [f"{reason}: {', '.join(sorted(set(names)))}" for reason, names in reasons.items()]
    untested = "; ".join(words.split(": ", 1)[-1] for words in verdict["untested"])
    return [
        ("Limitations of these recordings", list(verdict.get("limitations", ()))),
        ("What cannot be judged here, by reason", lines),
        ("Known, and not modelled", [untested] if untested else []),
    ]
