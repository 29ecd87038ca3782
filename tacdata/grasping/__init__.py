"""Grasping by touch: two fingertips estimate the place of an object between them, and move until it is central."""
