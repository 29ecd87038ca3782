"""Pose of a camera in the world."""
