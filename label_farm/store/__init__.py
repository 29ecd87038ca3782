"""Solved presses, stored by the hash of all their inputs."""
