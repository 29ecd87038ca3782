"""Recordings shown while they are made."""
