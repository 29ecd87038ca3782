"""Recordings as a course, and checks of their information."""
