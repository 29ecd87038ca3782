"""What a backend's file holds: one class that draws a scene."""

from __future__ import annotations

from abc import ABC, abstractmethod

from viewers.scene.scene import Scene


class Backend(ABC):
    """Draws scenes. A backend decides how things look, never what they are."""

    @abstractmethod
    def draw(self, scene: Scene) -> None:
        """Draw everything in ``scene``; parts that are absent are left out without complaint."""
