"""A verdict for reading."""

from __future__ import annotations

from typing import Any

from tacdata.discrepancy.search.gate import GATE
from tacdata.effects import library, load

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
    lines.append(
        f"could it be chance? p = {gate['p']:.3f} over all effects, {gate['p_generic']:.3f} for patterns of no effect; "
        f"a gap from {GATE:g} down"
    )
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
        titles = [words.split(": ", 1)[-1] for words in verdict["untested"]]
        few = "; ".join(titles) if len(titles) <= MOST_UNJUDGED else f"{len(titles)} effects; verdict.html lists them"
        lines.append(f"known, not modelled: {few}")
    return "\n".join(lines) + "\n"


def answered(verdict: dict[str, Any]) -> set[str]:
    """Return the effects of which the verdict speaks already: all forms of its answer and of what may stand in for it.

    Beside the answer they explain nothing more: that is no limit of seeing them.
    """
    spoken = {name for e in verdict["effects"] for name in (e["mechanism"], *e["alternatives"])}
    return {e["effect"] for e in verdict["effects"]} | {e.name for e in library() if e.called in spoken}


def _effect(entry: dict[str, Any]) -> list[str]:
    effect = load(entry["effect"])
    lines = [f"  {entry['mechanism']}: {_standing(entry)}", f"    {effect.title}"]
    meanings = {p.name: p.meaning for p in effect.parameters}
    for name, p in entry["parameters"].items():
        unit = "" if p["unit"] == "1" else f" {p['unit']}"
        meaning = f" ({meanings[name]})" if name in meanings else ""
        if isinstance(p["value"], list):
            each = f"{min(p['value']):.4g} to {max(p['value']):.4g}{unit} over the channels"
            lines.append(f"    {name}: {each}{meaning}")
        else:
            spread = f" +- {p['error']:.2g}" if p["error"] is not None else ""
            lines.append(f"    {name} = {p['value']:.4g}{spread}{unit}{meaning}")
    if entry["alternatives"]:
        lines.append(f"    these presses leave open whether it is: {', '.join(entry['alternatives'])}")
    unphysical = entry.get("unphysical", [])
    if unphysical:
        lines.append(f"    does as well only with an unphysical size: {', '.join(unphysical)}")
    spoken = {*entry["alternatives"], *unphysical}
    rivals = sorted(entry["margins"].items(), key=lambda item: item[1])
    rivals = [(name, by) for name, by in rivals if load(name).called not in spoken]
    worse = [(name, by) for name, by in rivals if by > 0][:MOST_RIVALS]
    better = [(name, -by) for name, by in rivals if by <= 0][:MOST_RIVALS]
    if worse:
        lines.append(f"    better, in standard errors over episodes, than: {_by(worse)}")
    if better:
        lines.append(f"    worse, in standard errors over episodes, than: {_by(better)}")
    return lines


def _standing(entry: dict[str, Any]) -> str:
    """Return how sure an effect is, and of what: where only its family is, that it is the one that fits best."""
    status, sure = entry["status"], entry["confidence"]
    if entry.get("level") == "family":
        family = entry["family"]
        return f"fits best; {family} is named" if status == "named" else f"{status}; either way it is {family}"
    return status if status != "named" or sure is None else f"named, {100 * sure:.0f} % sure"


def _by(rivals: list[tuple[str, float]]) -> str:
    return ", ".join(f"{name} {by:.1f}" for name, by in rivals)


def _sizes(verdict: dict[str, Any]) -> list[str]:
    """Return how large the residual is, with what each number is; before and after only where something was added."""
    left, sealed, none = verdict["left"], verdict["sealed"], not verdict["effects"]
    if none:
        lines = [f"residual: {left['before']:.3f}; 1 is the noise floor"]
    else:
        lines = [f"residual: {left['before']:.3f} before, {left['after']:.3f} after; 1 is the noise floor"]
        lines.append(f"left of what could be explained: {100 * left['share']:.1f} % ({left['t']:.1f} standard errors)")
    unit = "mean squares over the noise; the residual leaves out what differs from press to press"
    if not sealed["episodes"]:
        return [*lines, f"  ({unit})"]
    head = f"{sealed['episodes']} sealed episodes: "
    if none:
        by_path = f"; {sealed['ceiling']:.3f} after a regression on the path's history"
        lines.append(f"{head}{sealed['before']:.3f}{by_path if sealed['ceiling'] < 0.9 * sealed['before'] else ''}")
    else:
        lines.append(f"{head}{sealed['before']:.3f} before, {sealed['after']:.3f} after{_closed(sealed)}")
        lines += [] if sealed["certain"] else _borne_out(sealed.get("ratio"))
    return [*lines, f"  ({unit}, the sealed episodes do not: they do not compare)"]


def _borne_out(ratio: dict[str, Any] | None) -> list[str]:
    """Return how much of the answer sealed episodes show, where each press's own pose and gain are accounted for."""
    if ratio is None or ratio["error"] is None:
        return []
    return [
        f"  they show {100 * ratio['share']:.0f} % of the answer (standard error {100 * ratio['error']:.0f} %), each "
        "press's own pose and gain aside: 100 % is expected with it, 0 % without"
    ]


def _closed(sealed: dict[str, Any]) -> str:
    """Return how far the gap on sealed episodes is closed, in words that follow its numbers."""
    best = f", {sealed['ceiling']:.3f} at best"
    ratio = sealed.get("ratio")
    if (ratio is None or ratio["observed"] < 0) and (worse := worsened(sealed["before"], sealed["after"])):
        return f": {worse}{best}"
    if not sealed["certain"]:
        return f" (90 %: {sealed['after_interval'][0]:.3g} to {sealed['after_interval'][1]:.3g}){best}"
    low, high = sealed["interval"]
    each = {load(name).called: share for name, share in sealed.get("shares", {}).items() if share > 0}
    parts = ", ".join(f"{name} {100 * share:.0f}" for name, share in each.items()) if len(each) > 1 else ""
    closed = f"{best}; {100 * sealed['closed']:.0f} % of the gap closed (90 %: {100 * low:.0f} to {100 * high:.0f} %)"
    return f"{closed}: {parts}" if parts else closed


def worsened(before: float, after: float) -> str:
    """Return in words that a mean square has not become smaller; empty where it has."""
    if after < before:
        return ""
    return f"worse by {100 * (after / before - 1):.0f} %" if after >= 1.005 * before else "no better"
