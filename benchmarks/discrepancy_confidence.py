"""Fit the confidence of `tacdata discrepancy` to verdicts of which the truth is known.

    python benchmarks/discrepancy_confidence.py FOLDER [--write]

FOLDER holds JSON files of development seeds with ``verdict`` (as `tacdata discrepancy` writes it), ``truth`` (the
mechanisms that may rightly be named) and, for the record, ``engine`` and ``block``: `hidden_worlds/score.py --dump`
writes them. Every effect that a verdict names counts once. With ``--write`` the map goes into
tacdata/discrepancy/verdict/confidence.json; without, only how well it does is printed: Brier score and calibration
error, each
world judged by a map fitted without it.
"""

import json
import sys
from collections import Counter
from pathlib import Path

import numpy as np

from tacdata.discrepancy.verdict.confidence import FILE, fit

FEWEST = 60
"""Fewer names fit no map."""


def names(folder):
    """Return features of every name and whether it is right."""
    rows, right = [], []
    for path in sorted(folder.glob("*.json")):
        given = json.loads(path.read_text())
        truth = given["truth"]
        for effect in given["verdict"]["effects"]:
            if (
                effect["status"] == "named"
                and given["verdict"]["status"] in ("named", "ambiguous")
                and "features" in effect
            ):
                rows.append(effect["features"])
                right.append(effect["mechanism"] in truth)
    return rows, right


def counted(folder, key):
    """Return the number of files for each value of a key."""
    told = (json.loads(path.read_text()).get(key) for path in sorted(folder.glob("*.json")))
    return dict(sorted(Counter(value for value in told if value).items()))


def said(given, row):
    """Return the probability that a map gives."""
    score = given["intercept"] + sum(weight * row[name] for name, weight in given["weights"].items())
    return float(np.clip(1 / (1 + np.exp(-score)), *given["range"]))


def main(folder, write):
    """Fit, judge by leaving out tenths, write."""
    rows, right = names(folder)
    print(f"{len(rows)} names, {sum(right)} right")
    if len(rows) < FEWEST or all(right) or not any(right):
        raise SystemExit(f"too few to fit: {FEWEST} names or more, some of them wrong")
    told = np.zeros(len(rows))
    for part in range(10):
        rest = [k for k in range(len(rows)) if k % 10 != part]
        made = fit([rows[k] for k in rest], [right[k] for k in rest])
        told[part::10] = [said(made, row) for row in rows[part::10]]
    truth = np.array(right, float)
    edges = np.clip((told * 10).astype(int), 0, 9)
    error = sum(abs(told[edges == b].mean() - truth[edges == b].mean()) * np.mean(edges == b) for b in np.unique(edges))
    brier = np.mean((told - truth) ** 2)
    print(f"left out: Brier {brier:.3f} (constant {truth.var():.3f}), calibration error {error:.3f}")
    if write:
        given = {
            **fit(rows, right),
            "command": "python benchmarks/discrepancy_confidence.py FOLDER --write",
            "worlds": counted(folder, "block"),
            "engines": counted(folder, "engine"),
        }
        target = Path(__file__).parents[1] / "tacdata" / "discrepancy" / "verdict" / FILE
        target.write_text(json.dumps(given, indent=1) + "\n")
        print(f"written: {target}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), "--write" in sys.argv)
