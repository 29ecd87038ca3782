"""A skin of its own for hidden worlds: closed forms, independent of the code under test."""

import numpy as np

COLUMNS, ROWS, PITCH_X, PITCH_Y = 6, 4, 1.9, 2.5
CHANNELS = COLUMNS * ROWS
LAYER = 3.3  # mm, thickness
SPREAD = 1.7  # mm, half width of the spread of stress under a layer of that thickness
STIFF = 0.085  # N / mm^1.5 at a radius of 1 mm
FULL = 0.35  # N, scale of a taxel's curve
GAIN, OFFSET = 3000.0, 9000.0  # counts
MAP_X, MAP_Y = 35, 26  # pixels of a depth map
HALF = (6.5, 5.0)  # mm, half the size of the skin


def centers():
    """Return the places of the channels [mm], shape (24, 2)."""
    x = (np.arange(COLUMNS) - (COLUMNS - 1) / 2) * PITCH_X
    y = (np.arange(ROWS) - (ROWS - 1) / 2) * PITCH_Y
    return np.array([(a, b) for b in y for a in x])


def force(depth, radius, layer=LAYER):
    """Return the force [N] of a sphere: Hertz with a bonded layer's polynomial (Dimitriadis et al. 2002)."""
    d = np.maximum(depth, 0.0)
    chi = np.sqrt(np.maximum(radius * d, 0.0)) / layer
    return STIFF * np.sqrt(radius) * d**1.5 * (1 + 1.13 * chi + 1.28 * chi**2 + 0.77 * chi**3)


def loads(pose, radius, layer=LAYER):
    """Return the load on each protrusion [N], shape (n, 24), for poses x, y, depth [mm], shape (n, 3)."""
    f = force(pose[:, 2], radius, layer)
    c = centers()
    width2 = (SPREAD * layer / LAYER) ** 2 + 0.5 * radius * np.maximum(pose[:, 2], 0.0)
    r2 = (pose[:, :1] - c[:, 0]) ** 2 + (pose[:, 1:2] - c[:, 1]) ** 2
    near = 1 + r2 / width2[:, None]
    return (f * 0.9 * PITCH_X * PITCH_Y / (2.1 * width2))[:, None] / (near * near * np.sqrt(near))


def both(pose, radius, layer=LAYER):
    """Return the loads and, last, the force [N], shape (n, 25)."""
    return np.column_stack([loads(pose, radius, layer), force(pose[:, 2], radius, layer)])


def counts(load):
    """Return readings above idle [counts] of loads [N]: a plate whose dielectric hardens."""
    q = load / FULL
    return GAIN * q / (1 + 0.35 * q)


def depth_map(pose, radius, layer=LAYER):
    """Return the depth of the skin's face [mm], shape (n, 35, 26): a cap, and a skirt that dies out over the layer."""
    x = ((np.arange(MAP_X) + 0.5) / MAP_X * 2 - 1) * HALF[0]
    y = ((np.arange(MAP_Y) + 0.5) / MAP_Y * 2 - 1) * HALF[1]
    r = np.hypot(x[None, :, None] - pose[:, 0, None, None], y[None, None, :] - pose[:, 1, None, None])
    d = np.maximum(pose[:, 2], 0.0)[:, None, None]
    R, h = np.broadcast_to(radius, len(pose))[:, None, None], np.broadcast_to(layer, len(pose))[:, None, None]
    a = np.sqrt(np.maximum(R * d, 1e-9))
    skirt = (d - a * a / (2 * R)) * np.exp(-np.maximum(r - a, 0.0) / (0.35 * h))
    return np.where(r < a, d - r * r / (2 * R), skirt)


def write_table(
    path, radii, deepest=1.6, nodes=(41, 33, 25), shift=(0.0, 0.0), radius_factor=1.0, layer=LAYER, order=None
):
    """Write the nominal response that the lab believes in, as a table of presses on a grid.

    Args:
        path: New file (.npz).
        radii: Radii of the tools [mm].
        deepest: Largest depth [mm].
        nodes: How many places along x and y, and depths: as many that an oracle does not see the table's own error.
        shift: Displacement of the simulated sensor [mm].
        radius_factor: Radius simulated over the true one [1].
        layer: Thickness simulated [mm].
        order: Channel of the simulation at the place of each channel.
    """
    x, y = np.linspace(-HALF[0], HALF[0], nodes[0]), np.linspace(-HALF[1], HALF[1], nodes[1])
    depth = deepest * np.linspace(0, 1, nodes[2]) ** 2
    gx, gy, gd = (g.ravel() for g in np.meshgrid(x, y, depth, indexing="ij"))
    pose = np.column_stack([gx + shift[0], gy + shift[1], gd])
    shape = (len(x), len(y), len(depth))
    load = np.stack([loads(pose, r * radius_factor, layer).reshape(*shape, -1) for r in radii])
    load = load if order is None else load[..., order]
    total = np.stack([force(gd, r * radius_factor, layer).reshape(shape) for r in radii])
    curve = np.linspace(0, 1.5 * load.max(), 600)
    np.savez_compressed(
        path,
        x=x,
        y=y,
        depth=depth,
        load=load.astype(np.float32),
        force=total,
        curve_load=curve,
        curve_signal=counts(curve) / GAIN,
        gain=np.full(CHANNELS, GAIN),
        offset=np.full(CHANNELS, OFFSET),
        tools=np.array([f"sphere_{r:g}" for r in radii]),
    )
