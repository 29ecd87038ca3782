"""Strategies that locate an object between a hand's fingertips, one per file."""
