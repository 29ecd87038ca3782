"""The content of a backend's file: one class that draws a scene."""

from abc import ABC, abstractmethod

from tacdata.viewers.scene.scene import Scene


class Backend(ABC):
    """Draws scenes. A backend decides the look, never the content."""

    @abstractmethod
    def draw(self, scene: Scene) -> None:
        """Draw everything in ``scene``; parts that are absent are left out without complaint."""
