"""The scene of a discrepancy verdict or of a revision."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.effects import load
from tacdata.viewers.scene.scene import Bars, Curves, Page, Scene

GATE = 0.01
"""p-value at or below which a gap counts as one (`tacdata.discrepancy`)."""
WIDE = 20.0
"""Ratio from which bars are drawn on a logarithmic axis."""
SURELY = 2.33
"""Standard errors by which a name must be better than another (`tacdata.discrepancy`)."""
RIVALS = 3
"""Rivals that are listed, the nearest first."""


def verdict_scene(
    title: str, verdict: dict[str, Any], picture: Path | None = None, curves: tuple[Curves, ...] = ()
) -> Scene:
    """Return a verdict in words and bars.

    Args:
        title: Heading.
        verdict: The document (`schemas/verdict.schema.json`).
        picture: The page with residuals in its folder, if there is one.
        curves: Readings and model before and after, if they exist.
    """
    words = verdict_words(title, verdict, picture.name if picture else None)
    bars = (*_left(verdict), *_slices(verdict), *_margins(verdict), *_limits(verdict))
    scene = _scene(f"{title}: {verdict['status']}", words, bars, curves)
    if picture is None:
        return scene
    return replace(scene, pages=(Page("residuals", "Residuals before and after", picture.read_bytes()),))


def revision_scene(title: str, revision: dict[str, Any], table: str, curves: tuple[Curves, ...]) -> Scene:
    """Return the outcome of a revision: the gap before and after, and readings of selected episodes.

    Args:
        title: Heading.
        revision: The document (`schemas/revision.schema.json`).
        table: The gap as a Markdown table.
        curves: Readings measured, before and after, one entry an episode.
    """
    gap = revision["gap"] or {}
    rows = [gap[key] for key in ("sealed", "worst") if gap.get(key)]
    rows += [{**entry, "name": f"left out: {entry['name']}"} for entry in gap.get("elsewhere", ())]
    names = [f"{entry['name']}, {when}" for entry in rows for when in ("before", "after")]
    values = np.array([entry[when] for entry in rows for when in ("before", "after")], float)
    added = ", ".join(f"**{entry['effect'] if isinstance(entry, dict) else entry}**" for entry in revision["added"])
    lines = [
        f"# {title}",
        "",
        f"- **Verdict** {revision['status']}",
        f"- **Added** {added or 'nothing'}",
        "",
        table,
        "",
    ]
    lines += [f"- next: {press}" for press in (revision.get("next") or {}).get("presses", [])]
    wide = bool(len(values)) and bool(values.max() > WIDE * values.min())
    title_of_bars = "Residual: mean square over the noise; 1 is the floor"
    bars = (Bars("gap", title_of_bars, tuple(names), values, 1.0, wide),) if rows else ()
    return _scene(title, "\n".join(lines), bars, curves)


def _scene(title: str, words: str, bars: tuple[Bars, ...], curves: tuple[Curves, ...] = ()) -> Scene:
    time = np.unique(np.concatenate([c.time_ns for c in curves])) if curves else np.zeros(0, np.int64)
    return Scene(title, words, time, np.arange(len(time)), curves=curves, bars=bars, kind="verdict")


def _distinguished(effect: dict[str, Any]) -> list[str]:
    """Return the nearest rivals by these recordings' own margins; the experiment only where a rival is open."""
    open_to = {*effect["alternatives"], effect["mechanism"]}
    nearest = _smallest(effect.get("margins", {}))
    excluded = [f"{name} by {by:.1f}" for name, by in nearest.items() if by > 0 and name not in open_to][:RIVALS]
    lines = []
    if excluded:
        lines.append(f"- distinguished in these recordings from: {', '.join(excluded)} standard errors")
    if effect["alternatives"]:
        lines.append(f"- an experiment that would distinguish them: {effect['experiment']}")
    return lines


def verdict_words(title: str, verdict: dict[str, Any], picture: str | None) -> str:
    """Return the verdict as Markdown: the conclusion, the evidence, the next step."""
    lines = [f"# {title}: {verdict['status']}", "", verdict["why"] + ".", ""]
    for effect in verdict["effects"]:
        lines += [f"## {effect['title']} ({effect['mechanism']}, {effect['stage']}): {effect['status']}", ""]
        for name, p in effect["parameters"].items():
            value = np.ravel(p["value"])
            a_channel = f"{value.min():.3g} to {value.max():.3g}, one a channel"
            value_text = f"{value[0]:.4g}" if len(value) == 1 else a_channel
            spread = f" ± {p['error']:.2g}" if p["error"] is not None else ""
            lines.append(f"- {name} = {value_text}{spread}" + (f" {p['unit']}" if p["unit"] != "1" else ""))
        if effect["alternatives"]:
            lines.append(f"- could also be: {', '.join(effect['alternatives'])}")
        lines += _distinguished(effect)
        if effect.get("confidence") is not None:
            lines.append(f"- probability that the name is right: {effect['confidence']:.0%}")
    gate, remainder = verdict["gate"], verdict["left"]
    share = f" **Left** {remainder['share']:.1%} of what could be explained." if verdict["effects"] else ""
    lines += [
        "",
        f"**Gap** p = {gate['p']:.3g} ({'a gap' if gate['gap'] else 'no gap'}; {GATE:g} or less is one).{share}",
        "",
    ]
    for heading, items in (
        ("Where it lives", verdict["located"]),
        ("Next", verdict["next"]),
        ("Of these recordings", verdict["remarks"]),
    ):
        if items:
            lines += [f"## {heading}", "", *(f"- {item}" for item in items), ""]
    judged = _smallest({name: value for name, value in verdict["limits"].items() if value})
    if unjudged := [name for name in _smallest(dict.fromkeys(verdict["unjudgeable"], 0.0)) if name not in judged]:
        lines += [f"Cannot be judged here: {', '.join(sorted(unjudged))}.", ""]
    if picture:
        lines.append(f"Residuals before and after are drawn in {picture}.")
    return "\n".join(lines)


def _left(verdict: dict[str, Any]) -> list[Bars]:
    names, remainder = ("before", "after", "noise floor"), verdict["left"]
    values = np.array([remainder["before"], remainder["after"], remainder["floor"]], float)
    # On a linear axis the bars near the noise floor would vanish.
    wide = values[0] > WIDE * min(values[1:])
    return [Bars("gap", "Residual: mean square over the noise", names, values, 1.0, bool(wide))]


def _slices(verdict: dict[str, Any]) -> list[Bars]:
    """Return where the residual lives, before and after."""
    entries = [s for s in verdict.get("slices", ()) if s["by"] != "stream"]
    if not entries:
        return []
    names = tuple(f"{s['by']}: {s['name']}, {when}" for s in entries for when in ("before", "after"))
    values = np.array([s[when] for s in entries for when in ("before", "after")], float)
    title = "Where it lives: mean square over the noise; 1 is the floor"
    return [Bars("slices", title, names, values, 1.0, bool(values.max() > WIDE * max(values.min(), 1e-9)))]


def _margins(verdict: dict[str, Any]) -> list[Bars]:
    charts = []
    for effect in verdict["effects"]:
        if margins := _smallest(effect["margins"]):
            title = f"{effect['mechanism']}: by how many standard errors better than"
            values = np.array([*margins.values()], float)
            charts.append(Bars(f"margins/{effect['effect']}", title, (*margins,), values, SURELY))
    return charts


def _limits(verdict: dict[str, Any]) -> list[Bars]:
    """Return how small an effect would have been seen, those that these recordings excite."""
    limits = _smallest({name: value for name, value in verdict["limits"].items() if value})
    title = "Least size found [usual size]"
    return [Bars("limits", title, (*limits,), np.array([*limits.values()], float), 1.0, True)] if limits else []


def _smallest(values: dict[str, float]) -> dict[str, float]:
    """Return the smallest value of each mechanism, smallest first, by the names of `tacdata list effects`."""
    found: dict[str, float] = {}
    for name, value in sorted(values.items(), key=lambda pair: pair[1]):
        found.setdefault(load(name).called, value)
    return found
