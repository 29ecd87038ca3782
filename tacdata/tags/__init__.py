"""AprilTag cubes to poses."""

from tacdata.tags.cube import Cube
from tacdata.tags.detector import detect_tags
from tacdata.tags.pose import CubePose, detect_cube
from tacdata.tags.tag import Tag

__all__ = ["Cube", "CubePose", "Tag", "detect_cube", "detect_tags"]
