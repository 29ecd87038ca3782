"""Recordings as a course, and checks of what they can carry."""
