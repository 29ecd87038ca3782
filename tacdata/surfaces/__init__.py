"""Closed triangle surfaces from files: read, checked, stored by content, smoothed, with distances."""
