"""Solved presses, stored by the hash of what decides them."""
