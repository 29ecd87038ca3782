"""Recordings as a course, and what they can and cannot tell."""
