"""Grasping by touch: two fingertips find out where an object lies between them, and move until it lies well."""
