"""From a file of one kind to its scene."""
