"""A difference in words and as a document."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from tacdata import provenance, schemas
from tacdata.effects import load
from tacdata.reference.difference import NAMED, Z90, ZERO, Difference, Mechanism, Size

NEGLIGIBLE = 0.3
"""A bound below this share of the changed sizes counts as nothing there [1]."""
SIMILAR = 0.25
"""Sizes that spread by less about their mean are given as one [1]."""
LISTED, LONGEST = 4, 40
"""Conditions that a sentence lists, and their letters at most; of more, only their number is given."""


@dataclass(frozen=True)
class Machines:
    """Names of the compared machines."""

    measured: tuple[str, ...]
    """Folders of the machine that is judged."""
    healthy: tuple[str, ...]
    """Folders of the healthy machine."""
    recorded: str
    """When the judged machine was recorded, as far as the recordings state it."""
    unit: str
    """Unit of the readings."""


def word(mechanism: str) -> str:
    """Return a mechanism as a person calls it."""
    return "zero of the readings" if mechanism == ZERO else load(mechanism).spoken


def sentence(result: Difference, unit: str) -> str:
    """Return the answer in one sentence, with sizes, units and the conditions without a change."""
    if result.status == "none":
        # The largest bound: no effect above it would have been missed.
        threshold = max((s.bound for m in result.mechanisms for s in m.sizes), default=0.0)
        bound = f": no named effect above {threshold:.2g} {unit}" if threshold else ""
        return f"The readings do not differ from the healthy machine beyond its own scatter{bound}."
    if not result.named:
        return (
            f"The readings differ from the healthy machine by up to {result.largest:.2g} {unit} ({result.where}), and "
            "no known effect explains it."
        )
    parts = "; ".join(_sized(result, m, unit) for m in result.named)
    more = "; something else differs, too" if result.status == "named, incomplete" else ""
    return f"Compared with the healthy machine: {parts}{more}."


def _sized(result: Difference, mechanism: Mechanism, unit: str) -> str:
    """Return one mechanism with its sizes where it is a change, and the bounds where it is none."""
    changed = mechanism.changed
    channels = {s.channel for s in changed}
    rival = f" (or {word(mechanism.rival)})" if mechanism.rival else ""
    sizes = f"{word(mechanism.name)}{rival} {_amount(changed, unit)}"
    if len(result.channels) > 1:
        named = _listed([result.channels[k] for k in sorted(channels)]) if len(channels) < 3 else len(channels)
        sizes += f" in {named} of {len(result.channels)}{' channels' * (len(channels) > 2)}"
    if len(result.conditions) == 1:
        return sizes
    places = {s.condition for s in changed}
    sizes += _at(changed, len(result.conditions))
    typical = sum(abs(s.peak) for s in changed) / len(changed)
    remainder = [s for s in mechanism.sizes if s.condition not in places and s.channel in channels]
    nothing = [s for s in remainder if s.bound < NEGLIGIBLE * typical]
    unsure = [s for s in remainder if s.bound >= NEGLIGIBLE * typical]
    if nothing:
        sizes += (
            f", nothing{_at(nothing, len(result.conditions))} (less than {max(s.bound for s in nothing):.2g} {unit})"
        )
    if unsure:
        sizes += f", open{_at(unsure, len(result.conditions))}"
    return sizes


def _at(sizes: Sequence[Size], total: int) -> str:
    """Return the conditions of sizes by name, or their number where the names are many or long."""
    places = list(dict.fromkeys(s.condition for s in sizes))
    names = _listed(places)
    return f" at {names}" if len(places) <= LISTED and len(names) <= LONGEST else f" in {len(places)} of {total} kinds"


def _amount(sizes: Sequence[Size], unit: str) -> str:
    """Return sizes in the readings' unit and as a share of the reading, one figure or a range."""
    peaks, shares = [s.peak for s in sizes], [100 * s.share for s in sizes]
    mean = sum(peaks) / len(peaks)
    # One figure where all agree; a range says that the effect is not the same everywhere.
    if max(abs(p - mean) for p in peaks) <= SIMILAR * abs(mean):
        return f"{mean:+.2g} {unit} ({sum(shares) / len(shares):+.0f} %)"
    return f"{min(peaks):+.2g} to {max(peaks):+.2g} {unit} ({min(shares):+.0f} to {max(shares):+.0f} %)"


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def table(result: Difference, unit: str) -> list[tuple[str, ...]]:
    """Return a row for each size: mechanism, condition, channel, size with its 90 % interval, share, change or not."""
    rows = []
    for m in result.mechanisms:
        for s in m.sizes:
            low, high = s.peak - Z90 * s.peak_error, s.peak + Z90 * s.peak_error
            size_text = f"{s.peak:+.3g} {unit} ({low:+.3g} to {high:+.3g})"
            if m.unit != "reading":
                size_text += f", from {s.value:.3g} {'' if m.unit == '1' else m.unit}".rstrip()
            verdict = "yes" if s.changed else "no"
            rows.append(
                (word(m.name), s.condition, result.channels[s.channel], size_text, f"{100 * s.share:+.1f} %", verdict)
            )
    return rows


def controls(result: Difference, unit: str) -> list[str]:
    """Return the control in words: the healthy machine compared with itself."""
    if not result.controls:
        return ["control: too few healthy presses to compare the machine with itself; record six or more of each kind"]
    return [
        f"control, {c.split} of the healthy machine: "
        + ("quiet" if c.quiet else "NOT QUIET, so no name is given")
        + (f", largest size {c.largest:.2g} {unit}" if c.largest else "")
        for c in result.controls
    ]


def remarks(result: Difference) -> list[str]:
    """Return the limits of the answer."""
    lines = []
    if any(m.name == "dry_friction" for m in result.named):
        lines.append("friction: presses of one speed do not distinguish dry from viscous friction")
    if result.named:
        lines.append(f"the named effects explain {100 * result.explained:.0f} % of the difference where they act")
    sized = {m.name for m in result.mechanisms}
    if small := [word(n) for n, p in result.probabilities.items() if p >= NAMED and n not in sized]:
        lines.append(f"{', '.join(small)}: probable where the speed changes, too small to count")
    if result.status == "unknown":
        lines.append("the judged sessions alone may show an effect by name: leave out --reference")
    if result.unmatched:
        lines.append(f"{result.unmatched} presses have too few counterparts in the other session and were left out")
    return lines


def text(result: Difference, heading: Machines) -> str:
    """Return everything for reading in a terminal."""
    lines = [f"{result.status.upper()}: {sentence(result, heading.unit)}", ""]
    recorded = f", recorded {heading.recorded}" if heading.recorded else ""
    lines += [f"machine: {', '.join(heading.measured)}{recorded}", f"healthy: {', '.join(heading.healthy)}"]
    lines += [f"version: tacdata {provenance.code_version()}", "", *controls(result, heading.unit)]
    rows = table(result, heading.unit)
    if rows:
        lines += [
            "",
            "sizes (largest change of the readings, 90 % interval, share of the reading, change beyond scatter):",
        ]
        widths = [max(len(r[k]) for r in rows) for k in range(6)]
        lines += ["  " + "  ".join(v.ljust(w) for v, w in zip(r, widths, strict=True)).rstrip() for r in rows]
    likely = [(m.name, m.probability) for m in result.mechanisms if m.name != ZERO]
    if likely:
        lines += ["", "probability: " + ", ".join(f"{word(n)} {p:.2f}" for n, p in likely)]
    return "\n".join([*lines, *(f"- {line}" for line in remarks(result))]) + "\n"


def document(result: Difference, heading: Machines, parents: dict[str, str]) -> dict[str, Any]:
    """Return the difference (`schemas/difference.schema.json`).

    Args:
        result: The difference.
        heading: Names of the compared machines.
        parents: Name to content hash of the sessions.
    """
    return {
        "version": schemas.version("difference"),
        "status": result.status,
        "sentence": sentence(result, heading.unit),
        "heading": {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(heading).items()},
        "differs": result.differs,
        "largest": result.largest,
        "explained": result.explained,
        "probabilities": result.probabilities,
        "mechanisms": [
            {
                "mechanism": m.name,
                "form": m.form,
                "unit": heading.unit if m.unit == "reading" else m.unit,
                "probability": m.probability,
                "rival": m.rival,
                "named": m in result.named,
                "sizes": [_size(s, result) for s in m.sizes],
            }
            for m in result.mechanisms
        ],
        "controls": [asdict(c) for c in result.controls],
        "conditions": [
            {"name": c.name, "healthy": len(c.healthy), "measured": len(c.measured)} for c in result.conditions
        ],
        "unmatched": result.unmatched,
        "remarks": remarks(result),
        "provenance": provenance.stamp("tacdata discrepancy --reference", parents, {}),
    }


def _size(size: Size, result: Difference) -> dict[str, Any]:
    interval = [size.value - Z90 * size.error, size.value + Z90 * size.error]
    return {**asdict(size), "channel": result.channels[size.channel], "interval": interval}
