"""A verdict for reading."""

from __future__ import annotations

from typing import Any

from tacdata.discrepancy.heading import origin, sentence, sizes
from tacdata.discrepancy.plain_number import plain_number
from tacdata.discrepancy.search.gate import GATE
from tacdata.discrepancy.verdict.residual_slices import NOWHERE, figure
from tacdata.effects import library, load

MOST_RIVALS = 6
"""Most rivals that are listed."""
MOST_WORDS = 200
"""Words of an unknown verdict, at most."""
MEAN_SQUARE = "as a mean square over the noise (1 is noise alone)"
WITHIN_NOISE = 2.0
"""An unexplained part within so many standard errors of zero counts as noise [1]."""
EVEN = 0.05
"""A rival that leads by less fits as well [standard errors]."""
LOW = 0.7
"""Mean square below which the text explains why it is less than 1 [noise floor]."""
BEST = 0.9
"""A regression on the path's history is mentioned below this share of the residual [1]."""
LEAST_CLOSED = 0.01
"""Least closed share of the sealed gap that is mentioned [1]."""
WEAK_LIMIT = 3.0
"""Effects with a larger detection limit are listed [typical sizes]."""


def in_text(verdict: dict[str, Any]) -> str:
    """Return a verdict (`schemas/verdict.schema.json`) for reading; an unknown one in `MOST_WORDS` words."""
    first, further = sentence(verdict["why"])
    lines = [f"{verdict['status'].upper()}: {first}", *(f"  {words}" for words in sizes(verdict))]
    lines += [f"  {words}" for words in (origin(verdict),) if words]
    lines += [further] if further else []
    if verdict["next"]:
        lines += ["", "next:", *(f"  {words}" for words in verdict["next"])]
    lines.append("")
    unknown = verdict["status"] == "unknown"
    for e in verdict["effects"]:
        lines += _effect(e)[:1] if unknown else _effect(e)
    lines += [_gate(verdict), *_sizes(verdict)]
    if verdict["located"] == [NOWHERE]:
        lines += [NOWHERE]
    elif verdict["located"]:
        lines += [f"where the residual is largest, {MEAN_SQUARE}:", *(f"  {words}" for words in verdict["located"])]
    if verdict.get("located_after") not in (None, [], verdict["located"]):
        lines += [
            f"where the unexplained part is largest, {MEAN_SQUARE}:",
            *(f"  {words}" for words in verdict["located_after"]),
        ]
    if remarks := unsaid(verdict):
        lines += ["of these recordings:", *(f"  {words}" for words in remarks)]
    lines += _folded(verdict)
    return "\n".join(_short(lines) if unknown else lines) + "\n"


def _short(lines: list[str]) -> list[str]:
    """Return the first lines, `MOST_WORDS` words in all, and where the others are."""
    more = "more: verdict.html"
    budget, head = MOST_WORDS - len(more.split()), []
    for line in lines:
        budget -= len(line.split())
        if budget < 0:
            # A heading without its lines is none.
            while head and (head[-1].endswith(":") or not head[-1]):
                head.pop()
            return [*head, more]
        head.append(line)
    return head


def _folded(verdict: dict[str, Any]) -> list[str]:
    """Return the number of entries in each folded part of verdict.html, as a line."""
    judged = answered(verdict)
    weak = [k for k, v in verdict["limits"].items() if (v is None or v > WEAK_LIMIT) and k not in judged]
    counts = [
        (len(set(verdict["unjudgeable"]) - judged), "effects that cannot be judged here"),
        (len(weak), "that show only beyond three times their usual size"),
        (len(verdict["untested"]), "that are known and not modelled"),
        (len(verdict.get("limitations", ())), "limitations of the recordings"),
    ]
    parts = [f"{count} {words}" for count, words in counts if count]
    return [f"listed in verdict.html: {', '.join(parts)}"] if parts else []


def unsaid(verdict: dict[str, Any]) -> list[str]:
    """Return the remarks on the recordings that the first sentence does not contain."""
    return [words for words in verdict["remarks"] if words not in verdict["why"]]


def _gate(verdict: dict[str, Any]) -> str:
    """Return a line on the gate: whether there is a gap, and its p-values."""
    gate, words = verdict["gate"], "yes, beyond chance"
    if not gate["gap"]:
        words = "not within a specimen, only between specimens" if between_specimens(verdict) else "none beyond chance"
    return (
        f"is there a gap? {words}: p = {gate['p']:.3f} for the known effects, {gate['p_generic']:.3f} for other "
        f"patterns ({GATE:g} or less is a gap)"
    )


def between_specimens(verdict: dict[str, Any]) -> bool:
    """Return whether only the comparison of specimens shows the effect.

    Each specimen has its own response curve, which absorbs the effect, so the residual does not contain it.
    """
    return not verdict["gate"]["gap"] and any(load(e["effect"]).in_series for e in verdict["effects"])


def answered(verdict: dict[str, Any]) -> set[str]:
    """Return all forms of the answer and its rivals.

    In addition to the answer they explain nothing, so their detection limits are meaningless.
    """
    spoken = {name for e in verdict["effects"] for name in (e["mechanism"], *e["alternatives"])}
    return {e["effect"] for e in verdict["effects"]} | {e.name for e in library() if e.called in spoken}


def _effect(entry: dict[str, Any]) -> list[str]:
    effect = load(entry["effect"])
    lines = [f"  {effect.spoken}: {_standing(entry)}", f"    {effect.title}"]
    meanings = {p.name: p.meaning for p in effect.parameters}
    vague = [name for name, p in entry["parameters"].items() if _is_vague(p)]
    for name, p in entry["parameters"].items():
        unit = "" if p["unit"] == "1" else f" {'of the ' * p['unit'].startswith('largest')}{p['unit']}"
        meaning = f" ({meanings[name]})" if name in meanings else ""
        if isinstance(p["value"], list):
            ends = dict.fromkeys(plain_number(value, 4) for value in (min(p["value"]), max(p["value"])))
            scope = " over the channels" if len(ends) > 1 else ""
            lines.append(f"    {name}: {' to '.join(ends)}{unit}{scope}{meaning}")
        else:
            spread = f" +- {plain_number(p['error'], 2)}" if p["error"] is not None else ""
            spread = "" if name in vague else spread
            lines.append(f"    {name} = {plain_number(p['value'], 2 if name in vague else 4)}{spread}{unit}{meaning}")
    if vague:
        they = "is not known: other values fit" if len(vague) == 1 else "are not known, each by itself: other pairs fit"
        lines.append(f"    {' and '.join(vague)} {they} as well")
    if entry["alternatives"]:
        spoken_rivals = ", ".join(load(name).spoken for name in entry["alternatives"])
        lines.append(f"    these presses do not rule out: {spoken_rivals}")
    unphysical = entry.get("unphysical", [])
    if unphysical:
        spoken_rivals = ", ".join(load(name).spoken for name in unphysical)
        lines.append(f"    does as well only with an unphysical size: {spoken_rivals}")
    spoken = {*entry["alternatives"], *unphysical}
    rivals: dict[str, float] = {}
    for name, by in sorted(entry["margins"].items(), key=lambda item: item[1]):
        if load(name).called not in spoken:
            rivals.setdefault(load(name).spoken, by)  # of several forms the nearest
    worse = [(name, by) for name, by in rivals.items() if by > 0][:MOST_RIVALS]
    even = [name for name, by in rivals.items() if -EVEN < by <= 0][:MOST_RIVALS]
    better = [(name, -by) for name, by in rivals.items() if by <= -EVEN][:MOST_RIVALS]
    if worse:
        lines.append(f"    fits better, by so many standard errors over presses, than: {_by(worse)}")
    if even:
        lines.append(f"    fits as well, with more numbers: {', '.join(even)}")
    if better:
        lines.append(f"    fits worse, by so many standard errors over presses, than: {_by(better)}")
    return lines


def _is_vague(parameter: dict[str, Any]) -> bool:
    """Return whether the error of a number is larger than the number."""
    value, error = parameter["value"], parameter["error"]
    return error is not None and not isinstance(value, list) and error > abs(value)


def _standing(entry: dict[str, Any]) -> str:
    """Return the status of an effect in words: with its confidence, or with the family if only that is named."""
    status, confidence = entry["status"], entry["confidence"]
    if entry.get("level") == "family":
        family = entry["family"]
        return f"fits best; {family} is named" if status == "named" else f"{status}; either way it is {family}"
    return status if status != "named" or confidence is None else f"named, {100 * confidence:.0f} % sure"


def _by(rivals: list[tuple[str, float]]) -> str:
    return ", ".join(f"{name} {by:.1f}" for name, by in rivals)


def _sizes(verdict: dict[str, Any]) -> list[str]:
    """Return lines on the mean squares of the residual; before and after only if the answer has effects."""
    remainder, sealed, none = verdict["left"], verdict["sealed"], not verdict["effects"]
    lines = [f"residual, {MEAN_SQUARE}:"]
    nuisances = "each press's own pose and gain"
    final = "" if none else f" before, {figure(remainder['after'])} after"
    remark = "" if none or remainder["after"] > LOW else "; below 1, since part of it had been taken for noise"
    lines.append(f"  fitted presses, without {nuisances}: {figure(remainder['before'])}{final}{remark}")
    if sealed["episodes"]:
        head = f"  {sealed['episodes']} sealed presses, with {nuisances}: {figure(sealed['before'])}"
        lines.append(f"{head}{'' if none else _closed(sealed, verdict['status'].startswith('named'))}")
        if sealed["ceiling"] < BEST * sealed["before" if none else "after"]:
            lines.append(
                f"  a regression on the path's history would bring the sealed ones to {figure(sealed['ceiling'])}"
            )
        closes = sealed["certain"] and sealed["closed"] >= LEAST_CLOSED
        lines += [] if none or closes else _borne_out(sealed.get("ratio"))
    if not none and remainder["after"] < remainder["before"]:
        clear = f"{remainder['t']:.1f} standard errors above zero"
        beyond = clear if remainder["t"] >= WITHIN_NOISE else "no more than chance"
        part = f"{_percent(remainder['share'])} of the explainable part ({beyond})"
        lines.append(f"unexplained: {part}")
    return lines


def _borne_out(ratio: dict[str, Any] | None) -> list[str]:
    """Return a line on the share of the answer in sealed episodes, given the pose and gain errors of each press."""
    if ratio is None or ratio["error"] is None:
        return []
    return [
        f"  pose and gain aside, they show {100 * ratio['share']:.0f} +- {100 * ratio['error']:.0f} % of "
        "what the effects predict (100 % if these are there, 0 % if not)"
    ]


def _closed(sealed: dict[str, Any], named: bool) -> str:
    """Return the closed share of the sealed gap, as the end of a line.

    Args:
        sealed: Entry ``sealed`` of the verdict.
        named: Whether the effects are named. If the fit is significantly worse, none is.
    """
    line, ratio = f" before, {figure(sealed['after'])} after", sealed.get("ratio")
    if (ratio is None or ratio["observed"] < 0) and (worse := worsened(sealed["before"], sealed["after"])):
        return f"{line}, {worse}{', no more than chance may do' if named and ratio is not None else ''}"
    if not sealed["certain"]:
        hidden = "" if sealed["after"] < sealed["before"] else "; pose and gain hide what the effects do"
        low, high = sealed["after_interval"]
        return f"{line} (90 %: {figure(low)} to {figure(high)}){hidden}"
    low, high = sealed["interval"]
    if sealed["closed"] < LEAST_CLOSED:
        return f"{line}, no better (90 %: {100 * low:.0f} to {100 * high:.0f} % of it closed)"
    each = {load(name).spoken: share for name, share in sealed.get("shares", {}).items() if share > 0}
    parts = ", ".join(f"{name} {100 * share:.0f} %" for name, share in each.items()) if len(each) > 1 else ""
    closed, low, high = (round(100 * part) for part in (sealed["closed"], low, high))
    extent = f"{closed} % of the gap closed (90 %: {low} to {high} %)"
    return f"{line}, {extent}: {parts}" if parts else f"{line}, {extent}"


def _percent(share: float) -> str:
    """Return a share [1] in percent, with a digit behind the point where it is small."""
    if share < 0.0005:
        return "less than 0.1 %"
    return f"{100 * share:.1f} %" if share < 0.1 else f"{100 * share:.0f} %"


def worsened(base: float, final: float) -> str:
    """Return in words that a mean square has not become smaller; empty where it has."""
    if final < base:
        return ""
    return f"worse by {100 * (final / base - 1):.0f} %" if final >= 1.005 * base else "no better"
