"""Puts this folder on the path: tests of the sub-rooms import its examples by name."""
