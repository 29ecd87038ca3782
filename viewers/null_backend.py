"""Draws nothing and remembers what it was given: for tests and benchmarks."""

from __future__ import annotations

from viewers.backend import Backend
from viewers.scene.scene import Scene


class NullBackend(Backend):
    """Records (kind, name, rows) of every part of the scenes that it is given."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, str, int]] = []
        """Kind, name and number of rows in time of each part, in the order of drawing."""

    def draw(self, scene: Scene) -> None:
        """Remember the parts of ``scene``."""
        self.calls.append(("scene", scene.title, len(scene.frame_ns)))
        self.calls += [("curves", c.name, len(c.time_ns)) for c in scene.curves]
        self.calls += [("taxels", a.name or "taxels", len(a.time_ns)) for a in scene.arrays]
        if scene.tip is not None:
            self.calls.append(("curves", scene.tip.name, len(scene.tip.time_ns)))
        self.calls += [("map", m.name, len(m.time_ns)) for m in scene.maps]
        self.calls += [("surface", s.name, len(s.time_ns)) for s in scene.surfaces]
        self.calls += [("body", b.name, len(b.time_ns)) for b in scene.bodies]
        for camera in scene.cameras:
            self.calls.append(("images", camera.name, len(camera.image_ns)))
            self.calls.append(("cube", camera.name, len(camera.cube_ns)))
        self.calls += [("phase", p.name, 1) for p in scene.phases]
        self.calls += [("trail", t.name, len(t.position)) for t in scene.trails]
        self.calls += [("cloud", c.name, len(c.time_ns)) for c in scene.clouds]
        self.calls += [("bars", b.name, len(b.values)) for b in scene.bars]
