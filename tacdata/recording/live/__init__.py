"""Threads and processes that run while a rig records."""
