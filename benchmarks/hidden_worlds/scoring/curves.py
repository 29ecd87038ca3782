"""Pictures of a run: power over size, and how confidence holds."""

import numpy as np

from scoring.measures import calibration, interval


def power(rows, path):
    """Draw the share detected, named and wrongly named over size in detection limits."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    sizes = [0.5, 1.0, 3.0, 10.0]
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.8), sharey=True, layout="constrained")
    for ax, response in zip(axes, ("table", "fitted"), strict=True):
        for shift, words, color, test in (
            (0.94, "a gap is seen", "tab:gray", lambda r: r["status"] not in ("none", None)),
            (1.00, "rightly named", "tab:green", lambda r: r["outcome"] == "success"),
            (1.06, "confidently wrong", "tab:red", lambda r: r["outcome"] == "wrong name"),
        ):
            points = []
            for size in sizes:
                chosen = [r for r in rows if r["block"] == f"singles{size:g}" and r["response"] == response]
                if chosen:
                    k = sum(test(r) for r in chosen)
                    points.append((size * shift, k / len(chosen), *interval(k, len(chosen))))
            if points:
                at, share, low, high = np.array(points).T
                ax.errorbar(at, share, [share - low, high - share], fmt="o-", color=color, label=words, capsize=2)
        n = sum(r["block"].startswith("singles") and r["response"] == response for r in rows)
        ax.set(
            xscale="log", ylim=(-0.02, 1.02), xlabel="size [detection limits]", title=f"{response} response, n = {n}"
        )
        ax.set_xticks(sizes, [f"{s:g}" for s in sizes])
        ax.minorticks_off()
    axes[0].set_ylabel("share of worlds")
    handles, words = max((ax.get_legend_handles_labels() for ax in axes), key=lambda item: len(item[0]))
    figure.legend(handles, words, loc="outside upper center", ncols=3, frameon=False)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def reliability(rows, path):
    """Draw the share of right names over the confidence given; return whether any was given."""
    pairs = [p for r in rows for p in r.get("confidence", [])]
    if not pairs:
        return False
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    error, brier, table = calibration(pairs)
    figure, ax = plt.subplots(figsize=(4.2, 4))
    ax.plot([0, 1], [0, 1], color="0.7", lw=1)
    for said, right, n in table:
        low, high = interval(round(right * n), n)
        ax.errorbar(said, right, [[right - low], [high - right]], fmt="o", color="tab:blue", ms=3 + np.sqrt(n))
    ax.set(
        xlabel="confidence given",
        ylabel="share right",
        xlim=(0, 1),
        ylim=(0, 1),
        title=f"n = {len(pairs)}, ECE {error:.3f}, Brier {brier:.3f}",
    )
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    plt.close(figure)
    return True
