"""A study in one picture: success with intervals beside the paper's, by position, moves, and the centroids' bias."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tacdata.grasping.trial import STRATEGIES

COLORS = {"contact_only": "0.55", "raw_taxel": "tab:orange", "dense_depth": "tab:blue", "solved_map": "black"}
NAMES = {name: name.replace("_", " ") for name in COLORS}
WIDTH = 0.26


def save(found: dict[str, Any], path: Path) -> None:
    """Draw a study (PNG)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 7), layout="constrained")
    axes = figure.subplots(2, 2)
    _success(axes[0, 0], found)
    _positions(axes[0, 1], found)
    _bias(axes[1, 0], found)
    _ways(axes[1, 1], found)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def _success(ax: Any, found: dict[str, Any]) -> None:
    for k, name in enumerate(STRATEGIES):
        for at, part in enumerate(("overall", "edge")):
            share, (held, of) = found["rates"][name][part], found["published"][part][name]
            rate, x = share["held"] / share["of"], at + WIDTH * (k - 1)
            low, high = share["wilson_95"]
            ax.bar(x, rate, 0.9 * WIDTH, color=COLORS[name], label=NAMES[name] if at == 0 else None)
            ax.errorbar(x, rate, [[max(rate - low, 0)], [max(high - rate, 0)]], color="black", capsize=3)
            ax.plot(x, held / of, "D", color="white", mec="black", label="paper" if at == k == 0 else None)
    ax.set(xticks=(0, 1), xticklabels=("all positions", "edge"), ylabel="held [1]", ylim=(0, 1.25))
    ax.set_title("held for 5 s, with 95 % Wilson intervals")
    ax.legend(fontsize=8, ncols=4, loc="upper center")


def _positions(ax: Any, found: dict[str, Any]) -> None:
    places = found["setup"]["places"]
    for k, name in enumerate(STRATEGIES):
        own = found["rates"][name]["by_position"]
        rates = [own[str(p)]["held"] / own[str(p)]["of"] for p in range(1, len(places) + 1)]
        ax.bar([p + WIDTH * (k - 1) for p in range(1, len(places) + 1)], rates, 0.9 * WIDTH, color=COLORS[name])
    for p in found["setup"]["edge"]:
        ax.axvspan(p - 0.5, p + 0.5, color="0.92", zorder=0)
    ticks = range(1, len(places) + 1)
    ax.set(xticks=ticks, xticklabels=[f"{p}\n{x:+g}" for p, x in zip(ticks, places, strict=True)], ylabel="held [1]")
    ax.set_title("by position [mm]; edge shaded")


def _bias(ax: Any, found: dict[str, Any]) -> None:
    own, band = found["bias"], found["setup"]["protocol"]["band"]
    for name in ("raw_taxel", "dense_depth", "solved_map"):
        points = [(x, y) for x, y in zip(own["true"], own[name], strict=True) if y is not None]
        line = "--" if name == "solved_map" else "-"
        ax.plot(*zip(*points, strict=True), color=COLORS[name], ls=line, label=NAMES[name])
    ax.plot(own["true"], own["true"], color="0.7", lw=0.8)
    ax.axhspan(0, band, color="tab:green", alpha=0.12, label="band")
    ax.axvline(found["lifting"]["holds_to"], color="tab:red", lw=0.8, label="the lift holds to")
    ax.set(xlabel="true lateral place of the contact [mm]", ylabel="believed [mm]", title="bias of the centre")
    ax.legend(fontsize=8)


def _ways(ax: Any, found: dict[str, Any]) -> None:
    for trial in found["trials"]:
        if trial["strategy"] == "contact_only":
            continue
        shift = -0.12 if trial["strategy"] == "raw_taxel" else 0.12
        moves = [k + shift for k in range(len(trial["truths"]))]
        ax.plot(moves, trial["truths"], color=COLORS[trial["strategy"]], lw=0.6, alpha=0.5)
        ax.plot(moves[-1], trial["truths"][-1], "o" if trial["held"] else "x", color=COLORS[trial["strategy"]], ms=4)
    band = found["setup"]["protocol"]["band"]
    ax.axhspan(-band, band, color="tab:green", alpha=0.12)
    ax.set(xlabel="adjustments", ylabel="true lateral place [mm]", title="every trial: held (o), lost (x)")
