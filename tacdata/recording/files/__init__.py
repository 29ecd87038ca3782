"""Recordings as MCAP files: written, read, recovered."""
