"""Fingertip paths from sightings."""
