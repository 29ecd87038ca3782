"""Make the default sensor's mesh anew and put it among those that ship: ``python -m tacdata.skin.pin_mesh``.

Needed when `tacdata.skin.mesher.RECIPE`, the default sensor's geometry or the default mesh settings change; it makes a
new version of the model. Of several attempts the mesh with the best worst element is kept.
"""

from __future__ import annotations

from pathlib import Path

from tacdata.sensor import default_sensor
from tacdata.skin.mesh import quality
from tacdata.skin.mesher import PINNED, MeshSettings, make_mesh, mesh_key

ATTEMPTS = 5


def pin() -> Path:
    """Replace the pinned mesh; return its path."""
    sensor, settings = default_sensor(), MeshSettings()
    best = max((make_mesh(sensor, settings) for _ in range(ATTEMPTS)), key=lambda mesh: quality(mesh).worst_ratio)
    for old in PINNED.glob("*.npz"):
        old.unlink()
    path = PINNED / f"{mesh_key(sensor, settings)}.npz"
    best.save(path)
    print(path.name, quality(best))
    return path


if __name__ == "__main__":
    pin()
