"""Formats that robots read, one per file; the file's name is the format's name."""
