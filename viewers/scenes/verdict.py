"""The scene of a discrepancy verdict or of a revision."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.viewers.scene.scene import Bars, Curves, Page, Scene

WIDE = 20.0
"""Ratio from which bars are drawn on a logarithmic axis."""
MECHANISMS = 12
"""Mechanisms that have a bar, the most probable first."""


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
    bars = (*_gap(verdict), *_probabilities(verdict), *_slices(verdict), *_limits(verdict))
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


def verdict_words(title: str, verdict: dict[str, Any], picture: str | None) -> str:
    """Return the verdict as Markdown: the conclusion, the evidence, the next step."""
    lines = [f"# {title}: {verdict['status']}", "", verdict["why"] + ".", ""]
    for effect in verdict["effects"]:
        lines += [f"## {effect['title']} ({effect['mechanism']}, {effect['stage']}): {effect['status']}", ""]
        for name, p in effect["parameters"].items():
            value = np.ravel(p["value"])
            value_text = (
                f"{value[0]:.4g}" if len(value) == 1 else f"{value.min():.3g} to {value.max():.3g}, one a channel"
            )
            spread = f" ± {p['error']:.2g}" if p["error"] is not None else ""
            lines.append(f"- {name} = {value_text}{spread}" + (f" {p['unit']}" if p["unit"] != "1" else ""))
        if effect["alternatives"]:
            lines.append(f"- could also be: {', '.join(effect['alternatives'])}")
            lines.append(f"- an experiment that would distinguish them: {effect['experiment']}")
        share = effect["probability"]["family" if effect.get("level") == "family" else "mechanism"]
        lines.append(f"- probability: {share:.1%}")
    posterior = verdict["posterior"]
    lines += [
        "",
        f"**Probability** that nothing is missing {posterior['nothing']:.1%}, that something without a name is there "
        f"{posterior['remainder']:.1%}.",
        "",
    ]
    for heading, items in (
        ("Where it lives", verdict["located"]),
        ("Next", verdict["next"]),
        ("Of these recordings", verdict["remarks"]),
    ):
        if items:
            lines += [f"## {heading}", "", *(f"- {item}" for item in items), ""]
    if verdict["unjudgeable"]:
        lines += ["Cannot be judged here: " + ", ".join(verdict["unjudgeable"]) + ".", ""]
    if picture:
        lines.append(f"The page with the residuals is {picture}.")
    return "\n".join(lines)


def _gap(verdict: dict[str, Any]) -> list[Bars]:
    gap = verdict["gap"]
    if "after" not in gap:
        return []
    names = ("before", "after", "noise floor")
    values = np.array([gap["before"], gap["after"], gap["floor"]], float)
    wide = values[0] > WIDE * min(values[1:])
    return [Bars("gap", "Residual: mean square over the noise", names, values, 1.0, bool(wide))]


def _probabilities(verdict: dict[str, Any]) -> list[Bars]:
    """Return the probability of each mechanism, and of a remainder."""
    posterior = verdict["posterior"]
    shares = {"no effect of the library": posterior["remainder"]}
    shares |= dict(list(posterior["mechanisms"].items())[:MECHANISMS])
    named = posterior["policy"].get("named", 1.0)
    values = np.array(list(shares.values()), float)
    return [
        Bars(
            "probabilities", "Probability that it is missing; the line is that of a name", tuple(shares), values, named
        )
    ]


def _slices(verdict: dict[str, Any]) -> list[Bars]:
    """Return where the residual lives, before and after."""
    entries = [s for s in verdict.get("slices", ()) if s["by"] != "stream"]
    if not entries:
        return []
    names = tuple(f"{s['by']}: {s['name']}, {when}" for s in entries for when in ("before", "after"))
    values = np.array([s[when] for s in entries for when in ("before", "after")], float)
    title = "Where it lives: mean square over the noise; 1 is the floor"
    return [Bars("slices", title, names, values, 1.0, bool(values.max() > WIDE * max(values.min(), 1e-9)))]


def _limits(verdict: dict[str, Any]) -> list[Bars]:
    """Return how small an effect would have been seen, those that these recordings excite."""
    limits = sorted(((n, v) for n, v in verdict["limits"].items() if v), key=lambda pair: pair[1])
    if not limits:
        return []
    title = "Would be found half the time at this part of its usual size"
    return [Bars("limits", title, tuple(n for n, _ in limits), np.array([v for _, v in limits], float), 1.0, True)]
