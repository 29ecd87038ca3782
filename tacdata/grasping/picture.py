"""Draws a study: success with intervals and the paper's, by position, moves, and the centroids' bias."""

from __future__ import annotations

from pathlib import Path
from typing import Any

COLORS = {"contact_only": "0.55", "raw_taxel": "tab:orange", "dense_depth": "tab:blue", "solved_map": "black"}
OTHERS = "tab:purple", "tab:brown", "tab:pink", "tab:cyan", "tab:olive"
"""Colours of strategies that the paper does not have."""
BREADTH = 0.78
"""Share of an axis' unit that the bars of one place take [1]."""


def _colors(study: dict[str, Any]) -> dict[str, str]:
    names = [name for name in study["rates"] if name not in COLORS]
    return COLORS | {name: OTHERS[k % len(OTHERS)] for k, name in enumerate(names)}


def _spread(study: dict[str, Any]) -> list[tuple[str, float, float]]:
    """Return name, offset and width of each strategy's bar about its place on an axis."""
    width = BREADTH / len(study["rates"])
    return [(name, width * (k - (len(study["rates"]) - 1) / 2), width) for k, name in enumerate(study["rates"])]


def save(study: dict[str, Any], path: Path) -> None:
    """Draw a study (PNG)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 7), layout="constrained")
    axes = figure.subplots(2, 2)
    _success(axes[0, 0], study)
    _positions(axes[0, 1], study)
    _bias(axes[1, 0], study)
    _ways(axes[1, 1], study)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def _success(ax: Any, study: dict[str, Any]) -> None:
    colors, named = _colors(study), False
    for name, shift, width in _spread(study):
        for at, part in enumerate(("overall", "edge")):
            share, published = study["rates"][name][part], study["published"][part].get(name)
            rate, x = share["held"] / share["of"], at + shift
            low, high = share["wilson_95"]
            ax.bar(x, rate, 0.9 * width, color=colors[name], label=name.replace("_", " ") if at == 0 else None)
            # An interval never begins above the rate, but rounding may say so.
            ax.errorbar(x, rate, [[max(rate - low, 0)], [max(high - rate, 0)]], color="black", capsize=3)
            if published:
                successes, of = published
                ax.plot(x, successes / of, "D", color="white", mec="black", label=None if named else "paper")
                named = True
    ax.set(xticks=(0, 1), xticklabels=("all positions", "edge"), ylabel="held [1]", ylim=(0, 1.25))
    ax.set_title("held for 5 s, with 95 % Wilson intervals")
    ax.legend(fontsize=8, ncols=4, loc="upper center")


def _positions(ax: Any, study: dict[str, Any]) -> None:
    places, colors = study["setup"]["places"], _colors(study)
    for name, shift, width in _spread(study):
        shares = study["rates"][name]["by_position"]
        rates = [shares[str(p)]["held"] / shares[str(p)]["of"] for p in range(1, len(places) + 1)]
        ax.bar([p + shift for p in range(1, len(places) + 1)], rates, 0.9 * width, color=colors[name])
    for p in study["setup"]["edge"]:
        ax.axvspan(p - 0.5, p + 0.5, color="0.92", zorder=0)
    ticks = range(1, len(places) + 1)
    ax.set(xticks=ticks, xticklabels=[f"{p}\n{x:+g}" for p, x in zip(ticks, places, strict=True)], ylabel="held [1]")
    ax.set_title("by position [mm]; edge shaded")


def _bias(ax: Any, study: dict[str, Any]) -> None:
    bias, band = study["bias"], study["setup"]["protocol"]["band"]
    for name in bias["accepted_to"]:
        # Where a strategy sees no contact, it believes nothing.
        points = [(x, y) for x, y in zip(bias["true"], bias[name], strict=True) if y is not None]
        line = "--" if name == "solved_map" else "-"
        ax.plot(*zip(*points, strict=True), color=_colors(study)[name], ls=line, label=name.replace("_", " "))
    ax.plot(bias["true"], bias["true"], color="0.7", lw=0.8)
    ax.axhspan(0, band, color="tab:green", alpha=0.12, label="band")
    ax.axvline(study["lifting"]["holds_to"], color="tab:red", lw=0.8, label="the lift holds to")
    ax.set(xlabel="true lateral place of the contact [mm]", ylabel="believed [mm]", title="bias of the centre")
    ax.legend(fontsize=8)


def _ways(ax: Any, study: dict[str, Any]) -> None:
    ways, colors = list(study["rates"]), _colors(study)
    for trial in study["trials"]:
        name = trial["strategy"]
        shift = 0.24 * (ways.index(name) / max(len(ways) - 1, 1) - 0.5)
        moves = [k + shift for k in range(len(trial["truths"]))]
        ax.plot(moves, trial["truths"], color=colors[name], lw=0.6, alpha=0.5)
        ax.plot(moves[-1], trial["truths"][-1], "o" if trial["held"] else "x", color=colors[name], ms=4)
    band = study["setup"]["protocol"]["band"]
    ax.axhspan(-band, band, color="tab:green", alpha=0.12)
    ax.set(xlabel="adjustments", ylabel="true lateral place [mm]", title="every trial: held (o), lost (x)")
