"""Foreign data with known content, as labs leave it."""

import numpy as np
import yaml

T0 = 1_743_486_221.25


def press_data(seed=0, channels=5, rate=50.0, depth=1.5, hold=1.0):
    """Return times [s], depths [mm], forces [N], channels [pF]: rest, press, hold, release, rest."""
    rng = np.random.default_rng(seed)
    knots = np.cumsum([0.0, 1.0, depth / 1.0, hold, depth / 1.0, 1.0])
    time = np.arange(0.0, knots[-1], 1 / rate)
    path = np.interp(time, knots, [-0.5, -0.5, depth, depth, -0.5, -0.5])
    force = 0.8 * np.maximum(path, 0.0) ** 1.5
    signals = 20 + 3 * np.maximum(path, 0.0)[:, None] * rng.uniform(0.3, 1, channels)
    return time, path, force, np.round(signals + rng.normal(0, 0.01, signals.shape), 4)


def mapping(folder, **changes):
    """Write a mapping for wide.csv; ``None`` takes a key out."""
    document = {
        "version": "1.0",
        "name": "bench",
        "files": {"data": {"path": "wide.csv", "time": {"column": "t"}}},
        "sensor": {"name": "five"},
        "taxels": {"file": "data", "columns": "cap*", "unit": "pF"},
        "position": {"file": "data", "depth": {"column": "disp"}},
        "measured": {"force": {"file": "data", "columns": "Fz"}},
        "indenter": {"shape": "sphere", "radius": 3.0},
    }
    document |= changes
    path = folder / "mapping.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in document.items() if v is not None}))
    return path


def wide_csv(path, data, delimiter=",", decimal=".", header="t [ms]{0}disp [um]{0}Fz [g]{0}{1}", begin=0.0):
    """Write times in ms, depths in um, forces in g."""
    time, depth, force, signals = data
    names = delimiter.join(f"cap{k} (pF)" for k in range(signals.shape[1]))
    lines = [header.format(delimiter, names)] if header else []
    for t, d, f, row in zip(time, depth, force, signals, strict=True):
        values = [f"{1000 * (t + begin):.3f}", f"{1000 * d:.2f}", f"{f / 9.80665e-3:.4f}", *(f"{v:.4f}" for v in row)]
        lines.append(delimiter.join(value.replace(".", decimal) for value in values))
    path.write_text("\n".join(lines) + "\n")
