"""The verdict as one page of HTML: findings, their confidence, and the next step."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from tacdata.discrepancy.heading import origin, sentence, sizes
from tacdata.discrepancy.page import charts
from tacdata.discrepancy.page.heat_map import heat_map
from tacdata.discrepancy.page.telling import ToldPress, telling
from tacdata.discrepancy.plain_number import plain_number
from tacdata.discrepancy.verdict.residual_table import Residuals
from tacdata.discrepancy.verdict.text import LEAST_CLOSED, between_specimens, unsaid
from tacdata.effects import Family, load

MOST_RIVALS = 4
"""Rivals of an effect that have a line, the nearest."""
LOOPS = {Family.SKIN_MEMORY.value, Family.FRICTION_AND_PLAY.value, Family.DELAY_AND_FILTER.value}
"""Families whose effects show as loops over depth."""
REST, NOISE = "left: a press's own pose and gain, and what has no name", "noise"
PARTED = ("phase", "depth", "rate")
"""Kinds of slices shown before and after, next to the map."""
TAKEN_OUT = "each press's own pose and gain taken out"
FILLED = 0.5
"""Share of its fields in which a map has readings enough, at least."""


@dataclass(frozen=True)
class Part:
    """One section of the page."""

    title: str
    pictures: tuple[str, ...] = ()
    """SVG."""
    lines: tuple[str, ...] = ()
    legend: tuple[tuple[str, str], ...] = ()
    """Class of the style sheet and words."""
    folded: bool = False
    """Whether it opens on a click."""


def verdict_page(verdict: dict[str, Any], found: Residuals) -> str:
    """Return the page.

    Args:
        verdict: `schemas/verdict.schema.json`.
        found: Readings and the model's predictions.
    """
    presses = telling(found)
    parts = [
        Part("What to do next", lines=tuple(verdict["next"])),
        _presses(verdict, found, presses),
        _loops(verdict, presses),
        _shares(verdict),
        _where(verdict, found),
        _path(verdict),
        _rivals(verdict),
        Part("Of these recordings", lines=tuple(unsaid(verdict))),
        *_folded(verdict),
    ]
    shown = [part for part in parts if part.pictures or part.lines]
    first, further = sentence(verdict["why"])
    head = {"sentence": first, "further": further, "sizes": sizes(verdict), "origin": origin(verdict)}
    return _template().render(verdict=verdict, head=head, parts=shown, tiles=_tiles(verdict))


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


def _presses(verdict: dict[str, Any], found: Residuals, presses: list[ToldPress]) -> Part:
    added = bool(verdict["effects"]) and not between_specimens(verdict)
    pictures: list[str] = []
    for p in presses:
        level = float(np.nanmedian(p.measured[:5]))
        lines = [("measured", p.measured - level), ("before", p.before - level)]
        left = [("before", p.measured - p.before)]
        if added:
            lines.append(("after", p.after - level))
            left.append(("after", p.measured - p.after))
        pictures.append(charts.curves(f"{p.name}, {p.stream}", p.time, lines, ("time [s]", "reading above idle")))
        pictures.append(charts.curves("residual; grey: noise", p.time, left, ("time [s]", "residual"), 2 * p.noise))
    kind = "Sealed presses that tell most" if found.sealed else "Presses that tell most"
    return Part(kind, tuple(pictures), legend=_legend(added))


def _legend(added: bool) -> tuple[tuple[str, str], ...]:
    last = (("after", "model with the effects"),) if added else ()
    return (("measured", "measured"), ("before", "model as it was"), *last)


def _loops(verdict: dict[str, Any], presses: list[ToldPress]) -> Part:
    if not any(e.get("family") in LOOPS for e in verdict["effects"]):
        return Part("")
    pictures = []
    for p in presses:
        # On the scale of the readings a loop is too thin to be seen.
        lines = [("measured", p.measured - p.before), ("after", p.after - p.before)]
        pictures.append(charts.curves(f"{p.name}, {p.stream}", p.depth, lines, ("depth [mm]", "beyond the model")))
    legend = (("measured", "measured, less the model as it was"), ("after", "what the effects add to it"))
    return Part("Loops over depth", tuple(pictures), legend=legend)


def _shares(verdict: dict[str, Any]) -> Part:
    """Return the sealed gap as one bar: each name, the remainder."""
    sealed = verdict["sealed"]
    if not sealed["episodes"] or not verdict["effects"] or not sealed["certain"] or sealed["closed"] <= 0:
        return Part("")
    named = [(name, share) for name, share in sealed["shares"].items() if share > 0]
    rest = max(1 - sealed["closed"], 0.0)
    kinds = [(f"share{k % 4}", load(name).spoken, share) for k, (name, share) in enumerate(named)]
    every = [*kinds, ("rest", REST, rest)]
    legend = tuple((kind, f"{name} {100 * share:.0f} %") for kind, name, share in every)
    return Part("The gap on sealed presses", (charts.shares_bar(every),), legend=legend)


def _where(verdict: dict[str, Any], found: Residuals) -> Part:
    made = heat_map(found)
    most = max(float(np.nanmax(made.before, initial=1.0)), 2.0)
    added = bool(verdict["effects"]) and not between_specimens(verdict)
    parts = [part for part in verdict["slices"] if part["by"] in PARTED] if added else []
    title = "before, each press's own pose and gain left in" if parts else "mean square over the noise"
    pictures, said = [], verdict["located"]
    if made.rows and (not parts or np.isfinite(made.before).mean() >= FILLED):
        pictures.append(charts.map_of(title, made.rows, made.columns, made.before, most))
    if parts:
        # Under poses and gains that effects do not explain, the map would hardly change.
        square = np.array([[part["before"], part["after"]] for part in parts])
        names, most = [part["name"] for part in parts], max(float(square.max()), 2.0)
        pictures.append(charts.map_of(TAKEN_OUT, names, ("before", "with the effects"), square, most))
        said = [words for words in said if words.split(":")[0] not in PARTED]
    after = verdict.get("located_after", ())
    rest = [f"without a name yet: {words}" for words in after if list(after) != verdict["located"]]
    beside = "the map holds each press's own pose and gain, too; these mean squares over the noise leave that out"
    located = (*(() if parts else (beside,)), *said) if said else ()
    title = "Where the gap lives" if verdict["gate"]["gap"] else "Where the residual is largest"
    return Part(title, tuple(pictures), (*located, *rest))


def _path(verdict: dict[str, Any]) -> Part:
    lines = []
    for step in verdict["path"]:
        title, share = load(step["effect"]).title, step["share"]
        told = "dropped, or replaced by another form" if share is None else f"{100 * share:.0f} %"
        lines.append(f"{title}: {told}")
    return Part("In which order effects were added, and what each explains beyond the others", lines=tuple(lines))


def _rivals(verdict: dict[str, Any]) -> Part:
    """Return one line a rival: why it is not the name, or why it may be."""
    lines = []
    for e in verdict["effects"]:
        mine, near, least = load(e["effect"]).spoken, set(e["alternatives"]), {}
        for name, by in sorted(e["margins"].items(), key=lambda item: item[1]):
            least.setdefault(load(name).called, by)
        for called, by in list(least.items())[:MOST_RIVALS]:
            other = load(called).spoken
            if called in e.get("unphysical", ()):
                lines.append(f"not {other}: it would need an unphysical size")
            elif called in near:
                form = ", but another form of it may not" if by > 0 else ""
                lines.append(f"{other} may stand in for {mine}: {_apart(by)}{form}")
            else:
                lines.append(f"not {other}: {_apart(by)} than {mine}")
    return Part("Why not the others", lines=tuple(dict.fromkeys(lines)))


def _apart(by: float) -> str:
    if by > 0:
        return f"it explains the presses worse by {by:.1f} standard errors"
    return f"it explains the presses better by {-by:.1f} standard errors" if by < 0 else "it explains them as well"


def _folded(verdict: dict[str, Any]) -> list[Part]:
    """Return the effects that cannot be judged, by reason, and those known and not modelled."""
    reasons: dict[str, list[str]] = {}
    for name, reason in verdict["unjudgeable"].items():
        reasons.setdefault(reason, []).append(load(name).spoken)
    lines = [f"{reason}: {', '.join(sorted(set(names)))}" for reason, names in reasons.items()]
    untested = "; ".join(words.split(": ", 1)[-1] for words in verdict["untested"])
    return [
        Part("Limitations of these recordings", lines=tuple(verdict.get("limitations", ())), folded=True),
        Part("What cannot be judged here, by reason", lines=tuple(lines), folded=True),
        Part("Known, and not modelled", lines=(untested,) if untested else (), folded=True),
    ]


@cache
def _template() -> Any:
    from jinja2 import Environment, PackageLoader

    return Environment(loader=PackageLoader("tacdata.discrepancy.page", "."), autoescape=True).get_template(
        "verdict.html.j2"
    )
