"""Tracks fingertips through one camera's images; searches first around their previous positions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.tags.camera import PinholeCamera
from tacdata.tags.cube.pose import CubePose, surroundings
from tacdata.tags.detection.detector import detect_tags, to_grey
from tacdata.tags.detection.tag import Tag
from tacdata.tags.fingers import Finger
from tacdata.tags.mixups import exchanged
from tacdata.tags.tips import View, view_of

SEARCH_EVERY = 6
"""Images between two searches of the whole image, while a finger, or every finger, is missing."""
REMEMBERED = 30
"""Images for which an unseen finger keeps its last pose as a hint."""


class FingerTracker:
    """Call `update` with every image of one camera.

    Example:
        ``tracker = FingerTracker(intrinsics, read_fingers(path)); view = tracker.update(image)``
    """

    def __init__(
        self, intrinsics: dict[str, Any], fingers: dict[str, Finger], search_every: int = SEARCH_EVERY
    ) -> None:
        """Keep the camera and the fingers; see `detect_fingers`.

        Raises:
            FormatError: If the intrinsics contradict themselves or there is no finger.
        """
        if not fingers:
            raise FormatError("no fingers", "one or more", "name them in the fingers file")
        self.camera, self.fingers = PinholeCamera.from_document(intrinsics), fingers
        self._every = max(search_every, 1)
        self._hints: dict[str, CubePose] = {}
        self._ages: dict[str, int] = {}
        self._since = self._every

    def update(self, image: np.ndarray) -> View:
        """Return the sightings in an image, grey or BGR uint8.

        Raises:
            UsageError: If the image is invalid or of another size than the intrinsics.
        """
        grey = to_grey(image)
        self.camera.check(grey)
        # Only fingers of the image before have a place near which it is worth looking.
        fresh = {name for name, age in self._ages.items() if age == 0}
        # Every few images all is searched: a finger that comes in is near no previous one.
        tags = [] if not fresh or self._since >= self._every else self._near(grey, fresh)
        unread = {name for name in fresh if not self._has_tag(name, tags)}
        self._since += 1
        # A finger is missing where it was: it may have moved far between two images.
        if not tags or unread:
            tags, self._since = detect_tags(grey, whole=False), 0
        view = view_of(grey, tags, self.camera, self.fingers, self._hints)
        # Of two consecutive images alone: a finger that was out of sight may well come back at another's place.
        recent = {name: pose for name, pose in self._hints.items() if self._ages[name] == 0}
        view = replace(view, remarks=view.remarks + exchanged(recent, view.cubes))
        self._remember(view)
        return view

    def _near(self, grey: np.ndarray, names: set[str]) -> list[Tag]:
        """Return the tags around the cubes' previous positions; overlapping boxes are merged."""
        boxes: list[tuple[int, int, int, int]] = []
        for name in names:
            box = surroundings(self._hints[name], self.fingers[name].cube, self.camera)
            while box is not None:
                hit = next((b for b in boxes if _overlap(b, box)), None)
                if hit is None:
                    boxes.append(box)
                    break
                boxes.remove(hit)
                box = (min(hit[0], box[0]), min(hit[1], box[1]), max(hit[2], box[2]), max(hit[3], box[3]))
        return [tag for box in boxes for tag in detect_tags(grey, whole=False, within=box)]

    def _has_tag(self, name: str, tags: list[Tag]) -> bool:
        return any(tag.id in self.fingers[name].cube.faces for tag in tags)

    def _remember(self, view: View) -> None:
        for name in self.fingers:
            if name in view.tips:
                self._hints[name], self._ages[name] = view.tips[name].cube, 0
            elif name in self._hints:
                self._ages[name] += 1
                if self._ages[name] > REMEMBERED:
                    del self._hints[name], self._ages[name]


def _overlap(a: tuple[int, int, int, int], b: tuple[int, int, int, int]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
