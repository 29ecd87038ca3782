"""Processes that solve jobs."""
