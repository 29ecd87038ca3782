"""A verdict for reading."""

from __future__ import annotations

from typing import Any

from tacdata.effects import library

MOST_RIVALS = 6
"""Most rivals that are listed."""
MOST_UNJUDGED = 6
"""Effects that cannot be judged are listed up to so many; of more, only their number is given."""
WEAK_LIMIT = 3.0
"""Effects with a larger detection limit are listed [typical sizes]."""


def in_text(verdict: dict[str, Any]) -> str:
    """Return a verdict (`schemas/verdict.schema.json`) for reading."""
    lines = [f"{verdict['status'].upper()}: {verdict['why']}", ""]
    for e in verdict["effects"]:
        lines += _effect(e)
    gate = verdict["gate"]
    lines += [""] if verdict["effects"] else []
    lines.append(f"gate: p = {gate['p']:.3f} over all effects, {gate['p_generic']:.3f} for patterns of no effect")
    lines += _sizes(verdict)
    if verdict["located"]:
        lines += ["where it lives:", *(f"  {words}" for words in verdict["located"])]
    if verdict.get("located_after"):
        lines += ["where what has no name lives:", *(f"  {words}" for words in verdict["located_after"])]
    if verdict["next"]:
        lines += ["next:", *(f"  {words}" for words in verdict["next"])]
    if verdict["remarks"]:
        lines += ["of these recordings:", *(f"  {words}" for words in verdict["remarks"])]
    spoken = answered(verdict)
    if hidden := sorted(set(verdict["unjudgeable"]) - spoken):
        few = ", ".join(hidden) if len(hidden) <= MOST_UNJUDGED else f"{len(hidden)} effects; verdict.html says why"
        lines.append(f"cannot be judged here: {few}")
    weak = [k for k, v in verdict["limits"].items() if (v is None or v > WEAK_LIMIT) and k not in spoken]
    if weak:
        lines.append("would be seen only at more than three times their usual size: " + ", ".join(sorted(weak)))
    if verdict["untested"]:
        lines.append("known, not modelled: " + "; ".join(verdict["untested"][:12]))
    return "\n".join(lines) + "\n"


def answered(verdict: dict[str, Any]) -> set[str]:
    """Return the effects of which the verdict speaks already: all forms of its answer and of what may stand in for it.

    Beside the answer they explain nothing more: that is no limit of seeing them.
    """
    spoken = {name for e in verdict["effects"] for name in (e["mechanism"], *e["alternatives"])}
    return {e["effect"] for e in verdict["effects"]} | {e.name for e in library() if e.called in spoken}


def _effect(entry: dict[str, Any]) -> list[str]:
    sure = entry["confidence"] if entry["status"] == "named" else None
    words = "" if sure is None else f", {100 * sure:.0f} % sure"
    status = entry["status"]
    if entry.get("level") == "family":
        status = f"{status}; its family is not: {entry['family']}"
    lines = [f"  {entry['mechanism']} ({entry['effect']}, {entry['stage']}): {status}{words}"]
    for name, p in entry["parameters"].items():
        if isinstance(p["value"], list):
            lines.append(f"    {name}: {min(p['value']):.4g} to {max(p['value']):.4g} {p['unit']} over the channels")
        else:
            spread = f" +- {p['error']:.2g}" if p["error"] is not None else ""
            lines.append(f"    {name} = {p['value']:.4g}{spread} {p['unit']}")
    rivals = sorted(entry["margins"].items(), key=lambda item: item[1])
    worse = [(name, by) for name, by in rivals if by > 0][:MOST_RIVALS]
    better = [(name, -by) for name, by in rivals if by <= 0][:MOST_RIVALS]
    if worse:
        lines.append(f"    better, in standard errors over episodes, than: {_by(worse)}")
    if better:
        lines.append(f"    worse, in standard errors over episodes, than: {_by(better)}")
    return lines


def _by(rivals: list[tuple[str, float]]) -> str:
    return ", ".join(f"{name} {by:.1f}" for name, by in rivals)


def _sizes(verdict: dict[str, Any]) -> list[str]:
    """Return how large the residual is, with what each number is; before and after only where something was added."""
    left, sealed, none = verdict["left"], verdict["sealed"], verdict["status"] == "none" and not verdict["effects"]
    if none:
        lines = [f"residual: {left['before']:.3f}; 1 is the noise floor"]
    else:
        lines = [f"residual: {left['before']:.3f} before, {left['after']:.3f} after; 1 is the noise floor"]
        lines.append(f"left of what could be explained: {100 * left['share']:.1f} % ({left['t']:.1f} standard errors)")
    unit = "mean squares over the noise; the residual is without what differs from press to press"
    if not sealed["episodes"]:
        return [*lines, f"  ({unit})"]
    head = f"{sealed['episodes']} sealed episodes: "
    if none:
        by_path = f"; {sealed['ceiling']:.3f} after a regression on the path's history"
        lines.append(f"{head}{sealed['before']:.3f}{by_path if sealed['ceiling'] < 0.9 * sealed['before'] else ''}")
    else:
        lines.append(f"{head}{sealed['before']:.3f} before, {sealed['after']:.3f} after{_closed(sealed)}")
    return [*lines, f"  ({unit}, the sealed episodes with it: they do not compare)"]


def _closed(sealed: dict[str, Any]) -> str:
    """Return how far the gap on sealed episodes is closed, in words that follow its numbers."""
    best = f", {sealed['ceiling']:.3f} at best"
    if worse := worsened(sealed["before"], sealed["after"]):
        return f": {worse}{best}"
    if not sealed["certain"]:
        return f" (90 %: {sealed['after_interval'][0]:.3g} to {sealed['after_interval'][1]:.3g}){best}"
    low, high = sealed["interval"]
    return f"{best}; {100 * sealed['closed']:.0f} % of the gap closed (90 %: {100 * low:.0f} to {100 * high:.0f} %)"


def worsened(before: float, after: float) -> str:
    """Return in words that a mean square has not become smaller; empty where it has."""
    if after < before:
        return ""
    return f"worse by {100 * (after / before - 1):.0f} %" if after >= 1.005 * before else "no better"
