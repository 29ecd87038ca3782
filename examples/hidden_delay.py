"""Hide a delay in made-up presses, import them as a lab's own files, and let the search find its name and size."""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import yaml

DELAY = 0.08
"""By how much the readings come late [s]: written in no file that the search reads."""
MAPPING = {
    "version": "1.0",
    "name": "bench",
    "files": {"log": {"path": "press_{trial}.csv", "time": {"column": "t", "unit": "s", "zero": "shared"}}},
    "sensor": {"name": "two pads", "columns": 2, "rows": 1, "pitch_x": 4.0, "pitch_y": 4.0},
    "taxels": {"file": "log", "columns": ["a", "b"], "unit": "pF"},
    "position": {"file": "log", "depth": {"column": "depth", "unit": "mm"}},
    "indenter": {"shape": "sphere", "radius": 3.0},
}


def write_presses(folder: Path, count: int = 24) -> None:
    """Write presses at three rates and two depths as CSV files, and the mapping that describes them."""
    rng, clock = np.random.default_rng(3), 0.0
    for k in range(count):
        deepest = (0.7, 1.0)[k % 2]
        way = (deepest + 0.3) / (0.5, 1.0, 3.0)[k // 2 % 3]
        at, path = np.cumsum([0, 1.0, way, 1.5, way, 1.5]), [-0.3, -0.3, deepest, deepest, -0.3, -0.3]
        time = np.arange(0, at[-1], 1 / 30)
        load = np.maximum(np.interp(time - DELAY, at, path), 0) ** 1.5
        readings = np.column_stack([100 + 50 * load, 90 + 20 * load]) + 0.1 * rng.normal(size=(len(time), 2))
        rows = np.column_stack([clock + time, np.interp(time, at, path), readings])
        np.savetxt(folder / f"press_{k:02d}.csv", rows, "%.5f", ",", header="t,depth,a,b", comments="")
        clock += at[-1] + 2
    (folder / "mapping.yaml").write_text(yaml.safe_dump(MAPPING))


def tacdata(*arguments: object) -> None:
    """Run a verb, as a person would."""
    print("$ tacdata", *arguments, flush=True)
    subprocess.run([sys.executable, "-m", "tacdata", *map(str, arguments)], check=True)


parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("hidden_delay"))
out = parser.parse_args().out
out.mkdir()
write_presses(out)
tacdata("import", out, "--mapping", out / "mapping.yaml", "--out", out / "session")
tacdata("discrepancy", out / "session", "--out", out / "verdict")
verdict = json.loads((out / "verdict" / "verdict.json").read_text())
found = {effect["effect"]: effect["parameters"] for effect in verdict["effects"]}
delay = found["latency"]["L"]
print(f"hidden: {1000 * DELAY:g} ms; found: {1000 * delay['value']:.1f} ± {1000 * delay['error']:.2g} ms")
assert verdict["status"] == "named" and abs(delay["value"] - DELAY) < 0.01
