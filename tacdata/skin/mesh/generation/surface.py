"""The closed surface of a flat slab with protrusions."""

from __future__ import annotations

import trimesh

from tacdata.sensor import Sensor
from tacdata.skin.mesh.generation.protrusion import Protrusion


def surface(sensor: Sensor, tip: float | None = None) -> trimesh.Trimesh:
    """Return the closed surface of slab and protrusions [mm, sensor frame], before a pad is bent.

    Args:
        sensor: Whose skin.
        tip: Edge length at the protrusions' tips [mm], as in `MeshSettings`.
    """
    skin = sensor.skin
    slab = trimesh.creation.box(extents=[skin.size_x, skin.size_y, skin.thickness])
    slab.apply_translation([0, 0, skin.thickness / 2])
    if not skin.protrusion_radius:
        return slab
    parts = [slab]
    for x, y in sensor.taxels.centers:
        # The prism reaches into the slab: the union joins bodies that overlap, not bodies that share a face.
        bump = Protrusion.of(skin).hull(min(0.5 * skin.thickness, skin.protrusion_radius), tip)
        bump.apply_translation([x, y, 0])
        parts.append(bump)
    return trimesh.boolean.union(parts, engine="manifold")
