"""Imports foreign data as recordings, by a mapping file; what is missing stays missing."""
