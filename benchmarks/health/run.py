"""Faults planted at a unit's second visit: does `tacdata health` say so, and does it accuse healthy units?

Prints a table: how often the right advice named the right channels, how often it came with other advice, and how
often healthy units were accused; shares with Wilson's interval at 95 %. ``python run.py --clean 30 --units 10``; units
below 2000 were looked at while the room was built, so held-out ones begin there.
"""

from __future__ import annotations

import argparse
import json
import shutil
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
from planted_faults import KINDS, Planted
from scipy.stats import binomtest
from unit_visits import record

from tacdata.health.advice import NOTHING, Advice, advice
from tacdata.health.history import history
from tacdata.health.visit import Visit, read_visit


def first_visit(seed: int, folder: Path) -> Visit:
    """Return a unit's first visit."""
    return read_visit(record(folder / f"unit-{seed}", seed, 0))


def advised(before: Visit, seed: int, folder: Path, planted: Planted | None) -> tuple[Advice, ...]:
    """Return the advice at the second visit."""
    place = record(folder / f"again-{seed}", seed, 1, planted.fault if planted else None)
    try:
        return advice(history([before, read_visit(place)]))
    finally:
        shutil.rmtree(place)


def found(said: tuple[Advice, ...], planted: Planted) -> bool:
    """Whether the advice is the right one, of the right channels."""
    return any(a.do == planted.do and frozenset(a.channels) == planted.channels for a in said)


def beside(said: tuple[Advice, ...], planted: Planted) -> bool:
    """Whether something else is advised as well."""
    return any(a.do != planted.do or frozenset(a.channels) != planted.channels for a in said)


def interval(count: int, of: int) -> str:
    """Return a share with Wilson's interval, as text."""
    low, high = binomtest(count, of).proportion_ci(method="wilson")
    return f"{count} of {of} ({100 * low:.0f} to {100 * high:.0f} %)"


def main() -> None:
    """Run it and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=10, help="units for each fault")
    parser.add_argument("--clean", type=int, default=30, help="healthy units that are visited again")
    parser.add_argument("--first", type=int, default=2000, help="number of the first unit")
    parser.add_argument("--verbose", action="store_true", help="print what was said wrongly")
    given = parser.parse_args()
    units = range(given.first, given.first + max(given.units, given.clean))
    accused: Counter[str] = Counter()
    rows: dict[str, list[int]] = {name: [0, 0] for name in KINDS}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number, seed in enumerate(units):
            before = first_visit(seed, folder)
            if number < given.clean:
                said = advised(before, seed, folder, None)
                accused.update({a.do for a in said if a.do != NOTHING})
                if given.verbose and said[0].do != NOTHING:
                    print(f"healthy unit {seed}:", *(f"{a.do}: {a.why}" for a in said), sep="\n  ", flush=True)
            for kind, (title, plant) in enumerate(KINDS.items()):
                if number >= given.units:
                    break
                planted = plant(np.random.default_rng([seed, kind]))
                said = advised(before, seed, folder, planted)
                right, more = found(said, planted), beside(said, planted)
                rows[title][0] += right
                rows[title][1] += more
                if given.verbose and (more or not right):
                    print(
                        f"unit {seed}, {title} {sorted(planted.channels)}:",
                        *(f"{a.do} {a.channels}: {a.why}" for a in said),
                        sep="\n  ",
                        flush=True,
                    )
            shutil.rmtree(before.session.folder)
            if given.verbose:
                print(f"unit {seed} is done", flush=True)
    print("| fault | found | something else beside it |\n|---|---|---|")
    for title, (right, more) in rows.items() if given.units else ():
        print(f"| {title} | {interval(right, given.units)} | {more} of {given.units} |")
    print(f"healthy units accused: {interval(sum(accused.values()), given.clean)}; {json.dumps(dict(accused))}")


if __name__ == "__main__":
    main()
