"""A small recording that ships with tacdata: two presses on the virtual rig, and their depth maps."""

from tacdata.example.shipped import DEEPEST, copy_session

__all__ = ["DEEPEST", "copy_session"]
