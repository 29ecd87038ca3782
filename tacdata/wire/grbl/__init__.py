"""Speaks GRBL: lines and answers, real-time bytes, status reports."""
