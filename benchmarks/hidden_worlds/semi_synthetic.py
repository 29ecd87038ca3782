"""Put known effects into real recordings and judge them: python semi_synthetic.py SOURCE OUT [--mapping FILE].

Recordings keep their own noise and their own physics; the added effect is known exactly. The control is the recordings
as they are, and each half of them by itself: two halves of one recording must not get different names.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Injection:
    """One change of a recording's readings."""

    act: Callable
    """Takes times [s], shape (n,), and readings, shape (n, channels); returns both."""
    called: tuple
    """Names that a verdict may rightly give; empty: none, or words in a remark."""


def _part(t):
    return (t - t[0]) / (t[-1] - t[0])


def _late(t, y, tau):
    out, last = np.empty_like(y), y[0].copy()
    for i, dt in enumerate(np.diff(t, prepend=t[0])):
        last = last + dt / (tau + dt) * (y[i] - last)
        out[i] = last
    return out


def _crossed(t, y):
    side = np.roll(y - y[0], 1, axis=1)
    return t, y + 0.15 * side * (_part(t) > 0.5)[:, None]


def _swapped(t, y):
    late = _part(t) > 0.5
    out = y.copy()
    out[late, 0], out[late, 3] = y[late, 3], y[late, 0]
    return t, out


def _dead(t, y):
    out = y.copy()
    out[:, 2] = y[0, 2]
    return t, out


def _dropped(t, y):
    kept = np.random.default_rng(5).random(len(t)) > 0.2
    return t[kept], y[kept]


def _half(first):
    return lambda t, y: tuple(v[(_part(t) < 0.5) == first] for v in (t, y))


INJECTIONS = {
    "untouched": Injection(lambda t, y: (t, y), ()),
    "first half": Injection(_half(True), ()),
    "second half": Injection(_half(False), ()),
    "time shift 0.5 s": Injection(lambda t, y: (t + 0.5, y), ("latency",)),
    "low-pass 1 s": Injection(lambda t, y: (t, _late(t, y, 1.0)), ("low_pass_filter",)),
    "gain falls 20 %": Injection(lambda t, y: (t, y[0] + (y - y[0]) * (1 - 0.2 * _part(t))[:, None]), ("gain_drift",)),
    "drift": Injection(
        lambda t, y: (t, y + 0.15 * np.ptp(y, axis=0) * _part(t)[:, None] * np.cos(np.arange(y.shape[1]))), ("drift",)
    ),
    "crosstalk half way": Injection(_crossed, ()),
    "channels swapped half way": Injection(_swapped, ()),
    "dead channel": Injection(_dead, ()),
    "one frame in five lost": Injection(_dropped, ()),
}


def main(source, out, mapping, table, engine, only):
    """Judge every injection that is not judged yet, and print a table."""
    out.mkdir(parents=True, exist_ok=True)
    for name, injection in INJECTIONS.items():
        if only and not any(word in name for word in only):
            continue
        folder = out / name.replace(" ", "_").replace("%", "percent")
        if not (folder / "verdict" / "verdict.json").exists():
            shutil.rmtree(folder, ignore_errors=True)
            shutil.copytree(source, folder / "source")
            for path in sorted((folder / "source").rglob(table)):
                rows = np.loadtxt(path, delimiter=",", ndmin=2)
                t, y = injection.act(rows[:, 0], rows[:, 1:])
                np.savetxt(path, np.column_stack([t, y]), delimiter=",", fmt="%.9f")
            tacdata(engine, "import", folder / "source", "--mapping", mapping, "--out", folder / "session")
            tacdata(engine, "discrepancy", folder / "session", "--out", folder / "verdict")
        verdict = json.loads((folder / "verdict" / "verdict.json").read_text())
        print(line(name, injection, verdict), flush=True)


def tacdata(engine, *words):
    """Run a verb; a status of 3 is an import that left trials out."""
    code = "from tacdata.cli import main; main()"
    command = [sys.executable, "-c", code, *map(str, words)]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env={**os.environ, "PYTHONPATH": str(engine)}
    )
    if done.returncode not in (0, 3):
        raise SystemExit(done.stderr[-1500:] or done.stdout[-1500:])


def line(name, injection, verdict):
    """Return a line of the table: the added effect, the verdict, whether it holds the effect."""
    sets = [{e["mechanism"], *e["alternatives"]} for e in verdict["effects"]]
    certain = [e["mechanism"] for e in verdict["effects"] if e["status"] == "named" and verdict["status"] != "unknown"]
    wrong = [c for c in certain if c not in injection.called]
    held = any(s & set(injection.called) for s in sets) if injection.called else None
    words = {True: "among them", False: "not among them", None: "no name expected"}[held]
    told = " + ".join("/".join(sorted(s)) for s in sets) or "-"
    seen = [r for r in verdict["remarks"] if "channel" in r]
    given = f"{words}; named and not there: {', '.join(wrong) or 'none'}"
    return f"| {name} | {verdict['status']} | {told} | {given} | {'; '.join(seen)} |"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", type=Path, help="folder of CSV files: time first, then channels")
    parser.add_argument("out", type=Path)
    parser.add_argument("--mapping", type=Path, default=HERE / "eflesh.yaml", help="for `tacdata import`")
    parser.add_argument("--table", default="sensor.csv", help="name of the files that hold readings")
    parser.add_argument("--engine", type=Path, default=HERE.parents[1])
    parser.add_argument("--only", nargs="*", default=[], help="only injections whose names hold one of these")
    given = parser.parse_args()
    main(given.source, given.out, given.mapping, given.table, given.engine, given.only)
