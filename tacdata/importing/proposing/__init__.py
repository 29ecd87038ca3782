"""Inspects foreign files first: their contents, and a mapping to start from, with questions."""
