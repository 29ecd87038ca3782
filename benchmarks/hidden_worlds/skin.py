"""A skin of its own for hidden worlds: nothing here is shared with tacdata."""

import numpy as np

COLUMNS, ROWS, PITCH_X, PITCH_Y = 6, 4, 1.9, 2.5
SPREAD = 1.7      # mm, depth in the spreading of stress
STIFF = 0.085     # N / mm^1.5 at radius 1
FULL = 0.35       # N, load scale of a plate
GAIN, OFFSET = 3000.0, 9000.0


def centers():
    """Places of the channels [mm]."""
    x = (np.arange(COLUMNS) - (COLUMNS - 1) / 2) * PITCH_X
    y = (np.arange(ROWS) - (ROWS - 1) / 2) * PITCH_Y
    return np.array([(a, b) for b in y for a in x])


def force(depth, radius, layer=3.3):
    """Indentation force [N]: Hertz with a layer's stiffening (Dimitriadis-like polynomial)."""
    d = np.maximum(depth, 0.0)
    chi = np.sqrt(np.maximum(radius * d, 0.0)) / layer
    return STIFF * np.sqrt(radius) * d**1.5 * (1 + 1.13 * chi + 1.28 * chi**2 + 0.77 * chi**3)


def loads(x, y, depth, radius, layer=3.3):
    """Load on each protrusion [N], shape (n, 24)."""
    f = force(depth, radius, layer)
    c = centers()
    width2 = (SPREAD * layer / 3.3) ** 2 + 0.5 * radius * np.maximum(depth, 0.0)
    r2 = (x[:, None] - c[:, 0]) ** 2 + (y[:, None] - c[:, 1]) ** 2
    return f[:, None] * 0.9 * (1 + r2 / width2[:, None]) ** -2.5 * (PITCH_X * PITCH_Y) / (2.1 * width2[:, None])


def counts(load):
    """Readings above idle [counts] of loads [N]: a plate whose gap closes."""
    q = load / FULL
    return GAIN * q / (1 + 0.35 * q)


def write_table(path, radii, half=(6.5, 5.0), deepest=1.5):
    """Write the nominal response that the lab believes in, as a table."""
    x, y = np.linspace(-half[0], half[0], 27), np.linspace(-half[1], half[1], 21)
    depth = deepest * np.linspace(0, 1, 19) ** 2
    gx, gy, gd = (g.ravel() for g in np.meshgrid(x, y, depth, indexing="ij"))
    shape = (len(x), len(y), len(depth))
    load = np.stack([loads(gx, gy, gd, r).reshape(*shape, -1) for r in radii])
    total = np.stack([force(gd, r).reshape(shape) for r in radii])
    curve = np.linspace(0, 1.5 * load.max(), 600)
    np.savez_compressed(
        path, x=x, y=y, depth=depth, load=load, force=total, curve_load=curve, curve_signal=counts(curve) / GAIN,
        gain=np.full(24, GAIN), offset=np.full(24, OFFSET), tools=np.array([f"sphere_{r:g}" for r in radii]),
    )
