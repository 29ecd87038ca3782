"""The newest part of a scene, for a live viewer that has shown the rest."""

from dataclasses import fields, replace
from typing import Any

import numpy as np

from tacdata.viewers.scene.scene import CameraView, Cloud, Scene, Span

TIMED = ("time_ns", "values", "height", "depth", "position")
"""Fields with a row for each time; a grid's axes, and the turn of a body that does not turn, have none."""


class ScenePart:
    """Remembers the last shown time of each stream: some reach the disk later than others."""

    def __init__(self) -> None:
        self._shown: dict[str, int] = {}

    def newer(self, scene: Scene) -> Scene:
        """Return a scene with only the parts new since the last call; parts without time stay, and so do the phases."""
        return replace(
            scene,
            curves=self._known("curves", scene.curves),
            arrays=tuple(self._rows("arrays", item) for item in scene.arrays),
            tip=None if scene.tip is None else self._rows("tip", scene.tip),
            maps=self._known("maps", scene.maps),
            surfaces=self._known("surfaces", scene.surfaces),
            bodies=self._known("bodies", scene.bodies),
            clouds=tuple(self._cloud(item) for item in scene.clouds),
            cameras=tuple(self._camera(item) for item in scene.cameras),
        )

    def _known(self, group: str, parts: tuple[Any, ...]) -> tuple[Any, ...]:
        """Return the parts of which there is anything new."""
        return tuple(piece for piece in (self._rows(group, part) for part in parts) if len(piece.time_ns))

    def _later(self, key: str, time_ns: np.ndarray) -> np.ndarray:
        later = time_ns > self._shown.get(key, -1)
        if later.any():
            self._shown[key] = int(time_ns.max())
        return later

    def _rows(self, group: str, part: Any) -> Any:
        later = self._later(f"{group}/{part.name}", part.time_ns)
        arrays: dict[str, np.ndarray] = {}
        for name in (field.name for field in fields(part)):
            value = getattr(part, name)
            turns = name == "quaternion" and value.ndim == 2
            if (name in TIMED and isinstance(value, np.ndarray)) or turns:
                arrays[name] = value[later]
        return replace(part, **arrays)

    def _cloud(self, cloud: Cloud) -> Cloud:
        later = self._later(f"clouds/{cloud.name}", cloud.time_ns)
        points = np.repeat(later, cloud.count)
        return replace(
            cloud,
            time_ns=cloud.time_ns[later],
            count=cloud.count[later],
            position=cloud.position[points],
            values=cloud.values[points],
        )

    def _camera(self, camera: CameraView) -> CameraView:
        images = self._later(f"images/{camera.name}", camera.image_ns)
        cubes = self._later(f"cubes/{camera.name}", camera.cube_ns)
        return replace(
            camera,
            image_ns=camera.image_ns[images],
            images=tuple(image for image, is_new in zip(camera.images, images.tolist(), strict=True) if is_new),
            cube_ns=camera.cube_ns[cubes],
            cube_position=camera.cube_position[cubes],
            cube_quaternion=camera.cube_quaternion[cubes],
        )


def open_ended(spans: tuple[Span, ...]) -> tuple[Span, ...]:
    """Return phases of which the last goes on: it has a beginning and no end yet."""
    return (*spans[:-1], replace(spans[-1], end_ns=spans[-1].start_ns)) if spans else ()
