"""A robot: its URDF, which links carry fingertips, its limits."""

from tacdata.replay.robot.robot_file import Robot, read_robot

__all__ = ["Robot", "read_robot"]
