"""Closed triangle surfaces from files: read, checked, kept by content, smoothed, and asked for distances."""
