"""Poses of AprilTag cubes, and of the fingertips that carry them."""

from tacdata.tags.cube.cube import Cube
from tacdata.tags.cube.pose import CubePose, detect_cube
from tacdata.tags.detection.detector import detect_tags
from tacdata.tags.detection.tag import Tag
from tacdata.tags.fingers import Finger, fingers_of, read_fingers
from tacdata.tags.tips import TipPose, View, detect_fingers, look
from tacdata.tags.tracker import FingerTracker

__all__ = [
    "Cube",
    "CubePose",
    "Finger",
    "FingerTracker",
    "Tag",
    "TipPose",
    "View",
    "detect_cube",
    "detect_fingers",
    "detect_tags",
    "fingers_of",
    "look",
    "read_fingers",
]
