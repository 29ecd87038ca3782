"""Puts this folder on the path: tests of the sub-rooms import the simulated world by name."""
