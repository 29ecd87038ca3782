"""Worlds whose skin is finite elements, judged from the base that --fem solves: python run.py OUT solve|judge|score."""

import argparse
import contextlib
import json
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path
from unittest import mock

import numpy as np

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks" / "hidden_worlds")]

import run as hidden_worlds  # noqa: E402
from scoring.gathered import rows  # noqa: E402
from units import UNITS, sensor_of, tools  # noqa: E402
from worlds import skin, world, written  # noqa: E402
from worlds.cases import cases  # noqa: E402

from tacdata.chain.table_response import TableResponse  # noqa: E402
from tacdata.skin.mesh.build import MeshSettings  # noqa: E402
from tacdata.surrogate.build import FINE, TableSettings, work  # noqa: E402
from tacdata.surrogate.grid import UNIT, Reach  # noqa: E402

LOW, HIGH = (-3.8, -2.5), (3.8, 2.5)
"""Places that the worlds press [mm]."""
DEEPEST, DEEP = 1.25, 1.6
"""Depth of their deepest press, and of the skin's own table [mm]."""
SPACING, FINER = 0.4, 2
"""Of the skin's own places [mm]; its depths are as many times finer as the base's."""
BASES = ("fem", "fine", "skin")
"""As --fem solves it; on the default mesh, places every 0.8 mm; the skin itself, which has no error."""
SINGLES = ("relaxation", "latency", "crosstalk", "xy_offset", "frame_compliance", "hysteresis")


def solved(unit, device, capacity, out):
    """Solve a unit's own skin and its bases; print the time of each."""
    sensor, begun = sensor_of(unit), time.time()
    settings = TableSettings(device=device, capacity=capacity)
    for base in BASES:
        target = out / "units" / unit / f"{base}.npz"
        if target.exists():
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        reaches = {
            name: Reach(tool, 0.0, LOW, HIGH, DEEP if base == "skin" else DEEPEST) for name, tool in tools().items()
        }
        spacing = {"fem": None, "fine": FINE, "skin": SPACING}[base]
        given = settings if base == "fem" else replace(settings, spacing=spacing, mesh=MeshSettings())
        ready = work(sensor, reaches, given)
        if base == "skin":
            # At half the distance in the root of depth.
            states = int(np.ceil(np.sqrt(DEEP / UNIT) * FINER)) + 1
            depth = UNIT * (np.arange(states + len(ready.grid.depth) - ready.grid.states) / FINER) ** 2
            ready = replace(ready, grid=replace(ready.grid, depth=depth))
        print(f"{unit} {base}: {ready.presses} presses, {len(ready.missing)} to solve", flush=True)
        table, off = ready.done(lambda done, of, left: None)
        table.write(
            target,
            {
                "unit": unit,
                "base": base,
                "mesh": asdict(ready.model.settings.mesh),
                "left_out": asdict(off) if off else None,
            },
        )
        print(f"{unit} {base}: {time.time() - begun:.0f} s, {off}", flush=True)


@contextlib.contextmanager
def made_of(table):
    """Make worlds of the skin in a table."""
    response = TableResponse.read(table)

    def both(pose, radius, layer=skin.LAYER):
        tool = np.argmin(np.abs(np.subtract.outer(np.broadcast_to(radius, len(pose)), world.RADII)), axis=1)
        deep = pose.copy()
        return np.column_stack([response.load(deep, tool), response.force(deep, tool)])

    def counts(load):
        return response.signal(load) - response.offset

    with mock.patch.multiple(skin, both=both, counts=counts):
        yield


def wanted(seed, repeats):
    """Return the cases: nulls with a table, and a few singles of ten limits."""
    nulls = [c for r in range(repeats) for c in cases("nulls", seed, r)]
    singles = [c for c in cases("singles10", seed, 0) if c.name in SINGLES]
    kept = [c for c in (*nulls, *singles) if c.response == "table"]
    return sorted(kept, key=lambda c: c.identity)


def answered(given):
    """Judge one world from one base; return its row."""
    out, unit, base, case = given
    folder = out / unit / base
    kept = folder / "verdicts" / "workflow"
    target = kept / f"{case.identity}.json"
    if not target.exists():
        kept.mkdir(parents=True, exist_ok=True)
        (folder / "worlds").mkdir(exist_ok=True)
        nominal = folder / "worlds" / written.TABLE
        if not nominal.exists():
            nominal.write_bytes((out / "units" / unit / f"{base}.npz").read_bytes())
        with made_of(out / "units" / unit / "skin.npz"):
            written.write(folder, case)
        answer, said = hidden_worlds.judged(folder / "worlds" / case.identity, ROOT, {})
        if said is not None:
            target.with_suffix(".npz").write_bytes(said)
        engine = hidden_worlds.engine_of(ROOT)
        document = {"version": "1.0", "id": case.identity, "engine": engine, "options": {}, **answer}
        target.write_text(json.dumps(document))
    return f"{unit} {base} {case.name}"


def judged(out, seed, repeats, workers, units, bases, most):
    """Judge all worlds whose tables are there."""
    todo = [(out, unit, base, c) for c in wanted(seed, repeats)[:most] for unit in units for base in bases]
    with ProcessPoolExecutor(workers) as pool:
        for k, done in enumerate(pool.map(answered, todo)):
            print(f"{k + 1} of {len(todo)}: {done}", flush=True)


def scored(out):
    """Print the outcomes of the verdicts, by unit and base."""
    print("| unit | base | nulls | quiet | named | singles of ten limits | right | wrong |")
    print("|---|---|---:|---:|---:|---:|---:|---:|")
    for unit, base in ((u, b) for u in UNITS for b in BASES):
        if not (out / unit / base).exists():
            continue
        found = rows(out / unit / base, "workflow")
        nulls = Counter(r["outcome"] for r in found if r["block"] == "nulls")
        singles = Counter(r["outcome"] for r in found if r["block"] != "nulls")
        wrong = sum(count for outcome, count in singles.items() if outcome.startswith("wrong"))
        figures = (nulls.total(), nulls["right none"], nulls["false name"], singles.total(), singles["success"], wrong)
        print("|", " | ".join([unit, base, *map(str, figures)]), "|")


def main():
    """Do one step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("step", choices=("solve", "judge", "score"))
    parser.add_argument("--units", nargs="*", default=list(UNITS))
    parser.add_argument("--bases", nargs="*", default=list(BASES))
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--capacity", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--most", type=int, help="Worlds of each unit.")
    given = parser.parse_args()
    if given.step == "solve":
        for unit in given.units:
            solved(unit, given.device, given.capacity, given.out)
    elif given.step == "judge":
        judged(given.out, given.seed, given.repeats, given.workers, given.units, given.bases, given.most)
    else:
        scored(given.out)


if __name__ == "__main__":
    main()
