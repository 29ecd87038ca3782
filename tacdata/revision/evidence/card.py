"""The evidence card: one page of HTML with everything that a person needs to judge a verdict."""

from __future__ import annotations

import base64
import html
from pathlib import Path
from typing import Any

from tacdata.revision.evidence.table import in_words

CHANNELS = 6
"""Number of channels listed, the worst first."""
STYLE = """
body{font:15px/1.45 system-ui,sans-serif;max-width:60rem;margin:1.5rem auto;padding:0 1rem;color:#1a1a1a}
h1{font-size:1.5rem;margin:.2rem 0}h2{font-size:1.05rem;margin:1.4rem 0 .3rem;border-bottom:1px solid #ddd}
.status{display:inline-block;padding:.1rem .6rem;border-radius:.3rem;color:#fff;font-weight:600;background:#555}
.named{background:#00664d}.ambiguous{background:#8a5a00}.unknown{background:#7a1f5c}
.big{font-size:2rem;font-weight:600}.tiles{display:flex;gap:2rem;flex-wrap:wrap;margin:.8rem 0}
.tile{min-width:9rem}.tile span{display:block;color:#555;font-size:.85rem}
table{border-collapse:collapse;margin:.3rem 0}td,th{text-align:left;padding:.15rem .9rem .15rem 0;vertical-align:top}
th{font-weight:600;color:#555}img{width:100%;margin:.5rem 0}code{font-size:.8rem;word-break:break-all}
.small{color:#555;font-size:.85rem}@media print{body{margin:0}}
"""


def card(revision: dict[str, Any], verdict: dict[str, Any], picture: Path | None) -> str:
    """Return the page.

    Args:
        revision: `schemas/revision.schema.json`.
        verdict: `schemas/verdict.schema.json`.
        picture: A PNG to include, or None.
    """
    status, answer = verdict["status"], verdict["effects"]
    title = " and ".join(e["title"] for e in answer) or "No effect"
    if status == "unknown" and answer:
        title = f"Suspected, not named: {title}"
    parts = [
        f"<p class='status {status}'>{status}</p><h1>{_t(title)}</h1><p>{_t(verdict['why'])}</p>",
        _tiles(revision, verdict),
    ]
    if picture is not None:
        data = base64.b64encode(picture.read_bytes()).decode()
        parts.append(f"<img alt='readings and residuals before and after' src='data:image/png;base64,{data}'>")
    parts += [_parameters(answer), _rivals(answer), _gap(revision["gap"]), _slices(revision["gap"]), _labels(revision)]
    parts += [_tips(revision.get("tips") or []), _networks(revision.get("retrained"))]
    parts += [_confirmed(revision["confirmed"]), _refuted(verdict, answer), _next(revision["next"])]
    parts += [_data(verdict), _hashes(revision, verdict)]
    head = f"<!doctype html><html lang='en'><meta charset='utf-8'><title>{_t(title)}</title><style>{STYLE}</style>"
    return f"{head}<body>{''.join(parts)}</body></html>\n"


def _t(text: Any) -> str:
    return html.escape(str(text))


def _number(value: Any, digits: int = 3) -> str:
    return "–" if value is None else f"{value:.{digits}g}"


def _tiles(revision: dict[str, Any], verdict: dict[str, Any]) -> str:
    tiles = [("episodes judged", str(verdict["data"].get("episodes", "–")))]
    gap = revision["gap"]
    if gap:
        low, high = gap["interval"]
        closed = "–" if gap["closed"] is None else f"{100 * gap['closed']:.0f} %"
        spread = "" if low is None else f" ({100 * low:.0f} to {100 * high:.0f} %)"
        tiles.append((f"of the gap closed{spread}", closed))
        sealed = gap["sealed"]
        tiles.append(("residual before → after (1 is noise)", f"{sealed['before']:.3g} → {sealed['after']:.3g}"))
    moved = revision["labels"]
    if moved:
        tiles.append(("largest move of the tip [mm]", f"{max(m['path_most'] for m in moved):.3g}"))
    inner = "".join(f"<div class='tile'><div class='big'>{_t(v)}</div><span>{_t(n)}</span></div>" for n, v in tiles)
    return f"<div class='tiles'>{inner}</div>"


def _table(head: tuple[str, ...], rows: list[tuple[Any, ...]]) -> str:
    top = "".join(f"<th>{_t(h)}</th>" for h in head)
    body = "".join("<tr>" + "".join(f"<td>{_t(v)}</td>" for v in row) + "</tr>" for row in rows)
    return f"<table><tr>{top}</tr>{body}</table>"


def _parameters(answer: list[dict[str, Any]]) -> str:
    rows: list[tuple[Any, ...]] = []
    for e in answer:
        for name, p in e["parameters"].items():
            value = p["value"]
            if isinstance(value, list):
                shown, spread = f"{min(value):.3g} to {max(value):.3g} over the channels", _number(p["error"], 2)
            else:
                shown = f"{value:.4g}"
                spread = "{:.4g} to {:.4g}".format(*p["interval"]) if "interval" in p else _number(p["error"], 2)
            rows.append((e["effect"], name, shown, spread, p["unit"]))
    return (
        "" if not rows else "<h2>How large</h2>" + _table(("effect", "number", "value", "90 % interval", "unit"), rows)
    )


def _rivals(answer: list[dict[str, Any]]) -> str:
    rows = []
    for e in answer:
        for name, margin in sorted(e["margins"].items(), key=lambda item: item[1])[:6]:
            verdict = "could stand in its place" if name in e["alternatives"] or margin < 2.33 else "ruled out"
            rows.append((f"{name} instead of {e['effect']}", f"{margin:.1f}", verdict))
    listed = [f"{', '.join(e['alternatives'])} for {e['mechanism']}" for e in answer if e["alternatives"]]
    also = f"<p>Not told apart by these recordings: {_t('; '.join(listed))}.</p>" if listed else ""
    if not rows and not also:
        return ""
    head = ("rival", "worse by, in standard errors over episodes", "")
    return "<h2>What else it could be</h2>" + (_table(head, rows) if rows else "") + also


def _gap(gap: dict[str, Any] | None) -> str:
    if gap is None:
        return ""
    kept = "the verdict was reached without them" if gap["unseen"] else (
        "the effects' numbers were fitted without them; the name was not"
    )  # fmt: skip
    rows = [(f"sealed episodes: {kept}", gap["sealed"]), ("worst of them: " + gap["worst"]["name"], gap["worst"])]
    rows += [(f"{c['name']}, not fitted to", c) for c in gap["elsewhere"]]
    cells = [(name, c["episodes"], f"{c['before']:.3g}", f"{c['after']:.3g}") for name, c in rows]
    return "<h2>The gap</h2>" + _table(("where", "episodes", "before", "after (1 is the noise floor)"), cells)


def _slices(gap: dict[str, Any] | None) -> str:
    told = (gap or {}).get("slices") or []
    if not told:
        return ""
    worst = max(told, key=lambda c: c["after"])
    lost = [c["name"] for c in told if c["after"] > 1.1 * max(c["before"], 1.0)]
    words = f"Worst after: {worst['name']}, {worst['before']:.3g} before, {worst['after']:.3g} after."
    words += f" Worse than before: {', '.join(lost)}." if lost else " None became worse."
    channels = sorted((c for c in told if c["name"].startswith("channel")), key=lambda c: -c["after"])
    shown = [*(c for c in told if c not in channels), *channels[:CHANNELS]]
    if len(channels) > CHANNELS:
        words += f" Of {len(channels)} channels the {CHANNELS} worst are listed; gap.csv has all."
    words += " Contact that differs from press to press is in these figures, and not in those above."
    cells = [(c["name"], c["episodes"], f"{c['before']:.3g}", f"{c['after']:.3g}") for c in shown]
    head = ("of the sealed episodes", "episodes", "before", "after (1 is the noise floor)")
    return f"<h2>Where it lives</h2><p>{_t(words)}</p>" + _table(head, cells)


def _tips(told: list[dict[str, Any]]) -> str:
    if not told:
        return ""
    rows = [
        (t["session"], t["against"], t["episodes"], f"{t['before']:.4f} / {t['most_before']:.3f}",
         f"{t['after']:.4f} / {t['most_after']:.3f}", f"{t['better']} / {t['worse']}",
         f"{t['constant_before']:.4f} / {t['constant_after']:.4f}")
        for t in told
    ]  # fmt: skip
    head = ("session", "held against", "episodes", "before, rms / most [mm]", "after, rms / most [mm]",
            "episodes better / worse", "constant part, before / after [mm]")  # fmt: skip
    return "<h2>How far the labels' tip is off</h2>" + _table(head, rows)


def _networks(trained: dict[str, Any] | None) -> str:
    if not trained:
        return ""
    rows = [(m["title"], m["unit"], _number(m["before"]), _number(m["after"])) for m in trained["metrics"]]
    table = _table(("network", "unit", "before", "after"), rows)
    return f"<h2>What it does to a network</h2><p>{_t(in_words(trained))}</p>{table}"


def _labels(revision: dict[str, Any]) -> str:
    moved = revision["labels"]
    if not revision["added"]:
        return "<h2>Labels</h2><p>Nothing was named, so the model and its labels stay as they are.</p>"
    if not moved:
        return "<h2>Labels</h2><p>No label moves: the effect changes readings alone.</p>"
    rows = [
        (m["session"], f"{m['paths']} of {m['episodes']}", f"{m['path_rms']:.3g} / {m['path_most']:.3g}",
         m["labels"] or "not asked for", f"{_number(m['rms'])} / {_number(m['most'])}" if m["labels"] else "–")
        for m in moved
    ]  # fmt: skip
    head = ("session", "paths that move", "tip, rms / most [mm]", "labels made again", "depth, rms / most [mm]")
    return "<h2>Labels</h2>" + _table(head, rows)


def _confirmed(found: list[dict[str, Any]]) -> str:
    if not found:
        return ""
    rows = [
        (c["tool"], "{:.2f}, {:.2f}".format(*c["place"]), f"{c['depth']:.3f}", f"{100 * c['change']:.1f} %",
         f"{100 * c['difference']:.1f} %" if c["solved"] else "no equilibrium")
        for c in found
    ]  # fmt: skip
    head = ("tool", "place [mm]", "depth [mm]", "moved by the effect", "surrogate off finite elements (rms)")
    return "<h2>Solved again by finite elements</h2>" + _table(head, rows)


def _refuted(verdict: dict[str, Any], answer: list[dict[str, Any]]) -> str:
    lines = [f"<li>{_t(e['mechanism'])}: {_t(e['experiment'])}</li>" for e in answer]
    missing = verdict["untested"][:6]
    if missing:
        lines.append(f"<li class='small'>known, not modelled, so not tested: {_t('; '.join(missing))}</li>")
    return f"<h2>What would refute it</h2><ul>{''.join(lines)}</ul>" if lines else ""


def _next(following: dict[str, Any]) -> str:
    lines = "".join(f"<li>{_t(p)}</li>" for p in following["presses"])
    plan = f"<p>Plan: <code>tacdata record --plan {_t(following['plan'])}</code></p>" if following["plan"] else ""
    if not (lines or following["remark"]):
        return ""
    return f"<h2>What to record next</h2><p>{_t(following['remark'])}</p><ul>{lines}</ul>{plan}"


def _data(verdict: dict[str, Any]) -> str:
    data = verdict["data"]
    told = "; ".join(
        f"{name} {f'{value:.4g}' if isinstance(value, float) else value}"
        for name, value in data.items()
        if not isinstance(value, list | dict)
    )
    remarks = "".join(f"<li>{_t(r)}</li>" for r in verdict["remarks"])
    return f"<h2>The recordings</h2><p class='small'>{_t(told)}</p><ul class='small'>{remarks}</ul>"


def _hashes(revision: dict[str, Any], verdict: dict[str, Any]) -> str:
    rows = [("verdict", revision["verdict"]), ("model before", revision["spec"]["before"])]
    if revision["spec"]["after"]:
        rows.append(("model after", revision["spec"]["after"]))
    rows += [(n, h) for n, h in verdict["provenance"].get("parents", {}).items() if n != "spec"]
    rows.append(("code", revision["provenance"]["code_version"]))
    body = "".join(f"<tr><td>{_t(n)}</td><td><code>{_t(v)}</code></td></tr>" for n, v in rows)
    return f"<h2>Made from</h2><table class='small'>{body}</table>"
