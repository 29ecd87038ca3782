"""Another lab's files, with two clocks, decimal commas, grams and micrometres, become recordings like any other."""

import tempfile
from pathlib import Path

import numpy as np

import tacdata as td

MAPPING = Path(__file__).with_suffix(".yaml")
GRAM = 9.80665e-3


def press(seconds):
    """Return the depth [mm] of one press at times [s], shape (n,)."""
    return np.interp(seconds, [0, 2, 4, 6, 8], [-1.0, -1.0, 1.2, 1.2, -1.0])


def write(folder, number):
    """Write one press as the lab's programs do: a logger at 50 Hz and a stage at 20 Hz."""
    folder.mkdir()
    time = np.arange(0, 8, 0.02)
    depth = np.maximum(press(time), 0.0)
    lines = ["Messung vom 3. Mai", "Zeit;Kraft [g];Pad 1;Pad 2;Pad 3;Pad 4"]
    for k, (t, d) in enumerate(zip(time, depth, strict=True)):
        grams = -1 if k % 2 else 0.5 * d**1.5 / GRAM
        pads = [10 + (1 + 0.2 * pad + 0.1 * number) * d for pad in range(4)]
        lines.append(";".join(f"{value:.3f}".replace(".", ",") for value in (1000 * t, grams, *pads)))
    (folder / "logger.csv").write_text("\n".join(lines))
    stage = np.arange(0, 8, 0.05)
    rows = [f"{t - 2.5:.3f} 41.0 25.0 {1000 * (12.0 - d):.1f}" for t, d in zip(stage, press(stage), strict=True)]
    (folder / "stage.txt").write_text("\n".join(rows))


with tempfile.TemporaryDirectory() as name:
    source = Path(name) / "source"
    source.mkdir()
    for number in range(3):
        write(source / f"press_{number}", number)
    made = td.import_files(source, MAPPING, Path(name) / "session")
    episodes = list(td.read_session(made.folder))
    force = episodes[0].measured[0]
    depth = episodes[0].tip_at(force.sample_ns)[:, 2]
    error = np.abs(force.values[:, 0] - 0.5 * np.maximum(depth, 0.0) ** 1.5).max()
    print(f"{made.recordings} recordings, {len(force.values)} of {len(episodes[0].taxels.counts)} forces were read")
    print(f"force against depth, in newtons and millimetres, to {error:.3f} N")
    if error > 0.01 or episodes[0].press.x != 1.0:
        raise SystemExit("that is not what was written")
