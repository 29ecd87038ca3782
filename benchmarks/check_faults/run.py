"""Faults planted in clean sessions, by kind and size: which of them does `tacdata check` find?

Prints a table for `benchmarks/README.md`: the share found with Wilson's interval at 95 %, and the area under the ROC
curve of a score (reasons why it is unusable count ten, warnings one) against the clean sessions.

``python run.py --trials 4 --clean 100``; a fault that concerns one recording changes only that one.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.stats import binomtest, rankdata

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests" / "recording"))
from kinds import ALL, KINDS, LATER, UNKNOWABLE
from recorded import PRESSES, Recorded, plan_of

from tacdata.recording.check.findings import UNUSABLE, findings
from tacdata.recording.check.session import session_findings


class Clean:
    """A clean session, whose figures are computed once."""

    def __init__(self, seed, folder):
        self.seed, self.folder, self.plan = seed, folder / f"clean-{seed}", plan_of(seed)
        self.folder.mkdir()
        self.entries = [self.press(number).written(self.folder) for number in range(PRESSES)]
        self.score = score(self.entries)
        for finding in found(self.entries):
            print(f"clean session {seed}: {finding.file} {finding.text}", flush=True)

    def press(self, number):
        """Return one press as recorded, still clean."""
        return Recorded(self.plan, number, self.seed)

    def with_fault(self, plant, size, whole, trial):
        """Return the score of this session with a fault in it."""
        entries = list(self.entries)
        first = {LATER: PRESSES // 2, ALL: 0}
        numbers = range(first[whole], PRESSES) if whole in first else [trial % PRESSES]
        for number in numbers:
            press = self.press(number)
            plant(press, size, np.random.default_rng([self.seed, trial]))
            entries[number] = press.written(self.folder)
        return score(entries)


def found(entries):
    """Return all findings."""
    return [*(finding for entry in entries for finding in findings(entry)), *session_findings(entries)]


def score(entries):
    """Return ten for each reason why a session is unusable, and one for each warning."""
    return sum(10 if finding.severity == UNUSABLE else 1 for finding in found(entries))


def interval(found, of):
    """Return the share found with Wilson's interval, as text."""
    low, high = binomtest(found, of).proportion_ci(method="wilson")
    return f"{100 * found / of:.0f} % ({100 * low:.0f} to {100 * high:.0f})"


def area(faulty, clean):
    """Return the area under the ROC curve [1]."""
    ranks = rankdata([*faulty, *clean])[: len(faulty)].sum()
    return (ranks - len(faulty) * (len(faulty) + 1) / 2) / (len(faulty) * len(clean))


def main():
    """Run it and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=4, help="sessions per kind and size")
    parser.add_argument("--clean", type=int, default=100, help="clean sessions")
    parser.add_argument("--kinds", nargs="*", help="only these kinds, with _ for blanks")
    given = parser.parse_args()
    begin = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        clean = [Clean(seed, Path(folder)) for seed in range(given.clean)]
        scores = [session.score for session in clean]
        print(f"clean sessions with a remark: {interval(sum(s > 0 for s in scores), len(scores))}", flush=True)
        print("| fault | of | small | middle | large | found | AUC |\n|---|---|---|---|---|---|---|")
        everything = []
        for name, (plant, group, sizes, whole) in KINDS.items():
            if given.kinds and name.replace(" ", "_") not in given.kinds:
                continue
            table = [[clean[t].with_fault(plant, size, whole, t) for t in range(given.trials)] for size in sizes]
            cells = [f"{sum(s > 0 for s in row)} of {len(row)}" for row in table]
            faulty = [value for row in table for value in row]
            everything += faulty if group != UNKNOWABLE else []
            share, auc = interval(sum(s > 0 for s in faulty), len(faulty)), area(faulty, scores)
            sized = " / ".join(f"{size:g}" for size in sizes)
            print(f"| {name} ({sized}) | {group} | {' | '.join(cells)} | {share} | {auc:.2f} |", flush=True)
        print(f"all: AUC {area(everything, scores):.3f}; {time.process_time() - begin:.0f} s of a core")


if __name__ == "__main__":
    main()
