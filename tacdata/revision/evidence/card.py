"""The evidence card: one page of HTML with everything that a person needs to judge a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tacdata.discrepancy.heading import sentence, sizes
from tacdata.discrepancy.verdict.sealed import WIDEST
from tacdata.effects import load
from tacdata.pages import Band, HtmlPage, Items, PageHeader, Paragraph, Plot, Series, Slider, Table, Tiles
from tacdata.revision.evidence.table import in_words
from tacdata.viewers.scene.episode_curves import EpisodeCurves

CHANNELS = 6
"""Number of channels listed, the worst first."""


def card(revision: dict[str, Any], verdict: dict[str, Any], shown: Sequence[EpisodeCurves] = ()) -> str:
    """Return the page.

    Args:
        revision: `schemas/revision.schema.json`.
        verdict: `schemas/verdict.schema.json`.
        shown: Readings of a few episodes, and the models' predictions.
    """
    answer = verdict["effects"]
    page = HtmlPage(_header(revision, verdict))
    page.add("Result", Tiles(_tiles(revision, verdict)))
    if shown:
        panels = list(
            zip(*(_panels(episode, verdict.get("heading", {}).get("unit", "")) for episode in shown), strict=True)
        )
        names = [f"{episode.name}, {episode.channel_name}" for episode in shown]
        page.add("Readings before and after", Slider("episode, the largest change first", names, panels))
    _parameters(page, answer)
    _rivals(page, answer)
    if revision["gap"]:
        _gap(page, revision["gap"])
        _slices(page, revision["gap"].get("slices") or [])
    _labels(page, revision)
    _tips(page, revision.get("tips") or [])
    _networks(page, revision.get("retrained"))
    _confirmed(page, revision["confirmed"])
    _refuted(page, verdict, answer)
    _next(page, revision["next"])
    _data(page, verdict)
    _hashes(page, revision, verdict)
    return page.text


def _header(revision: dict[str, Any], verdict: dict[str, Any]) -> PageHeader:
    status, plan = verdict["status"], revision["next"]["plan"]
    title, further = sentence(verdict["why"])
    heading, stamp = verdict.get("heading", {}), revision["provenance"]
    return PageHeader(
        "Evidence card",
        title,
        of=", ".join(Path(path).name for path in heading.get("recordings", ())),
        made=stamp.get("made_at", "")[:10],
        version=stamp["code_version"],
        status=status,
        tone="good" if status == "named" else "",
        lines=[*sizes(verdict), *([further] if further else [])],
        next=[f"record what is missing: `tacdata record --plan {plan}`"] if plan else (),
    )


def _panels(episode: EpisodeCurves, unit: str) -> tuple[Plot, Plot]:
    """Return readings and residuals of an episode on the channel of its largest change."""
    c, names = episode.channel, (("model before", "vermilion", episode.before), ("model after", "blue", episode.after))
    measured = episode.measured[:, c]
    readings = [Series("measured", measured, "ink", width=3.0)]
    readings += [Series(name, predicted[:, c], color) for name, color, predicted in names]
    residuals = [Series(name, (measured - p[:, c]) / episode.noise[c], color) for name, color, p in names]
    noise = Band(-2.0, 2.0, "noise, two standard deviations")
    return (
        Plot("reading", "time [s]", f"reading [{unit}]" if unit else "reading", readings, episode.time, link="card"),
        Plot("residual over the noise", "time [s]", "residual [1]", residuals, episode.time, [noise], link="card"),
    )


def _number(value: Any, digits: int = 3) -> str:
    return "–" if value is None else f"{value:.{digits}g}"


def _tiles(revision: dict[str, Any], verdict: dict[str, Any]) -> list[tuple[str, str]]:
    tiles = [(str(verdict["data"].get("episodes", "–")), "episodes judged")]
    gap = revision["gap"]
    if gap:
        low, high = gap["interval"]
        if gap["closed"] is not None and low is not None and high - low < WIDEST:
            spread = f" ({100 * low:.0f} to {100 * high:.0f} %)"
            tiles.append((f"{100 * gap['closed']:.0f} %", f"of the gap closed{spread}"))
        sealed = gap["sealed"]
        tiles.append((f"{sealed['before']:.3g} → {sealed['after']:.3g}", "residual before → after (1 is noise)"))
    labels = revision["labels"]
    if labels:
        tiles.append((f"{max(m['path_most'] for m in labels):.3g} mm", "largest shift of the tip"))
    return tiles


def _table(page: HtmlPage, title: str, head: Sequence[str], rows: Sequence[Sequence[Any]], words: str = "") -> None:
    """Add a section with a table; none without rows."""
    if not rows:
        return
    page.add(title, Paragraph(words) if words else None, Table(head or ("what", "hash"), rows))


def _parameters(page: HtmlPage, answer: list[dict[str, Any]]) -> None:
    rows: list[tuple[Any, ...]] = []
    for e in answer:
        for name, p in e["parameters"].items():
            value = p["value"]
            if isinstance(value, list):
                ends = dict.fromkeys(f"{end:.3g}" for end in (min(value), max(value)))
                size = " to ".join(ends) + " over the channels" * (len(ends) > 1)
                spread = _number(p["error"], 2)
            else:
                size = f"{value:.4g}"
                spread = "{:.4g} to {:.4g}".format(*p["interval"]) if "interval" in p else _number(p["error"], 2)
            rows.append((load(e["effect"]).spoken, name, size, spread, p["unit"]))
    _table(page, "Size of the effects", ("effect", "parameter", "value", "90 % interval", "unit"), rows)


def _rivals(page: HtmlPage, answer: list[dict[str, Any]]) -> None:
    rows = []
    for e in answer:
        for name, margin in sorted(e["margins"].items(), key=lambda item: item[1])[:6]:
            verdict = "could stand in its place" if name in e["alternatives"] or margin < 2.33 else "ruled out"
            pair = f"{load(name).spoken} instead of {load(e['effect']).spoken}"
            rows.append((pair, f"{margin:.1f}", verdict))
    listed = [
        f"{', '.join(load(name).spoken for name in e['alternatives'])} for {load(e['mechanism']).spoken}"
        for e in answer
        if e["alternatives"]
    ]
    heads = ("rival", "worse by, in standard errors over episodes", "")
    words = Paragraph(f"Not separable by these recordings: {'; '.join(listed)}.") if listed else None
    page.add("What else it could be", Table(heads, rows) if rows else None, words)


def _gap(page: HtmlPage, gap: dict[str, Any]) -> None:
    reservation = (
        "the verdict was reached without them"
        if gap["unseen"]
        else ("the effects' parameters were fitted without them; the name was found with them")
    )
    rows = [
        (f"sealed episodes: {reservation}", gap["sealed"]),
        ("worst of them: " + gap["worst"]["name"], gap["worst"]),
    ]
    rows += [(f"{c['name']}, not fitted to", c) for c in gap["elsewhere"]]
    cells = [(name, c["episodes"], f"{c['before']:.3g}", f"{c['after']:.3g}") for name, c in rows]
    _table(page, "The gap", ("where", "episodes", "before", "after (1 is the noise floor)"), cells)


def _slices(page: HtmlPage, slices: list[dict[str, Any]]) -> None:
    if not slices:
        return
    worst = max(slices, key=lambda c: c["after"])
    lost = [c["name"] for c in slices if c["after"] > 1.1 * max(c["before"], 1.0)]
    words = f"Worst after: {worst['name']}, {worst['before']:.3g} before, {worst['after']:.3g} after."
    words += f" Worse than before: {', '.join(lost)}." if lost else " None became worse."
    channels = sorted((c for c in slices if c["name"].startswith("channel")), key=lambda c: -c["after"])
    listed = [*(c for c in slices if c not in channels), *channels[:CHANNELS]]
    if len(channels) > CHANNELS:
        words += f" Of {len(channels)} channels the {CHANNELS} worst are listed; gap.csv has all."
    words += " These figures include differences of the contact between presses; those above do not."
    cells = [(c["name"], c["episodes"], f"{c['before']:.3g}", f"{c['after']:.3g}") for c in listed]
    head = ("of the sealed episodes", "episodes", "before", "after (1 is the noise floor)")
    _table(page, "Where the gap is", head, cells, words)


def _tips(page: HtmlPage, tips: list[dict[str, Any]]) -> None:
    rows = [
        (
            t["session"],
            t["against"],
            t["episodes"],
            f"{t['before']:.4f} / {t['most_before']:.3f}",
            f"{t['after']:.4f} / {t['most_after']:.3f}",
            f"{t['better']} / {t['worse']}",
            f"{t['constant_before']:.4f} / {t['constant_after']:.4f}",
        )
        for t in tips
    ]
    head = (
        "session",
        "reference",
        "episodes",
        "before, rms / most [mm]",
        "after, rms / most [mm]",
        "episodes better / worse",
        "constant part, before / after [mm]",
    )
    _table(page, "Tip error of the labels", head, rows)


def _networks(page: HtmlPage, trained: dict[str, Any] | None) -> None:
    if not trained:
        return
    rows = [(m["title"], m["unit"], _number(m["before"]), _number(m["after"])) for m in trained["metrics"]]
    _table(page, "What it does to a network", ("network", "unit", "before", "after"), rows, in_words(trained))


def _labels(page: HtmlPage, revision: dict[str, Any]) -> None:
    labels = revision["labels"]
    if not (revision["added"] and labels):
        named = "No label changes: the effect acts on readings alone."
        none = "Nothing was named, so the model and its labels stay as they are."
        page.add("Labels", Paragraph(named if revision["added"] else none))
        return
    rows = [
        (
            m["session"],
            f"{m['paths']} of {m['episodes']}",
            f"{m['path_rms']:.3g} / {m['path_most']:.3g}",
            m["labels"] or "not requested",
            f"{_number(m['rms'])} / {_number(m['most'])}" if m["labels"] else "–",
        )
        for m in labels
    ]
    head = ("session", "paths that change", "tip, rms / most [mm]", "labels made again", "depth, rms / most [mm]")
    _table(page, "Labels", head, rows)


def _confirmed(page: HtmlPage, presses: list[dict[str, Any]]) -> None:
    rows = [
        (
            c["tool"],
            "{:.2f}, {:.2f}".format(*c["place"]),
            f"{c['depth']:.3f}",
            f"{100 * c['change']:.1f} %",
            f"{100 * c['difference']:.1f} %" if c["solved"] else "no equilibrium",
        )
        for c in presses
    ]
    head = ("tool", "place [mm]", "depth [mm]", "change by the effect", "surrogate minus finite elements (rms)")
    _table(page, "Solved again by finite elements", head, rows)


def _refuted(page: HtmlPage, verdict: dict[str, Any], answer: list[dict[str, Any]]) -> None:
    lines = [f"{e['mechanism']}: {e['experiment']}" for e in answer]
    missing = verdict["untested"][:6]
    if missing:
        lines.append(f"known, not modelled, so not tested: {'; '.join(missing)}")
    page.add("What would refute it", Items(lines) if lines else None)


def _next(page: HtmlPage, following: dict[str, Any]) -> None:
    if not (following["presses"] or following["remark"]):
        return
    plan = Paragraph(f"Plan: `tacdata record --plan {following['plan']}`") if following["plan"] else None
    presses = Items(following["presses"]) if following["presses"] else None
    page.add("What to record next", Paragraph(following["remark"]) if following["remark"] else None, presses, plan)


def _data(page: HtmlPage, verdict: dict[str, Any]) -> None:
    figures = "; ".join(
        f"{name} {f'{value:.4g}' if isinstance(value, float) else value}"
        for name, value in verdict["data"].items()
        if not isinstance(value, list | dict)
    )
    remarks = Items(verdict["remarks"], note=True) if verdict["remarks"] else None
    page.add("The recordings", Paragraph(figures, note=True), remarks)


def _hashes(page: HtmlPage, revision: dict[str, Any], verdict: dict[str, Any]) -> None:
    rows = [("verdict", revision["verdict"]), ("model before", revision["spec"]["before"])]
    if revision["spec"]["after"]:
        rows.append(("model after", revision["spec"]["after"]))
    rows += [(n, h) for n, h in verdict["provenance"].get("parents", {}).items() if n != "spec"]
    rows.append(("code", revision["provenance"]["code_version"]))
    _table(page, "Made from", (), rows)
