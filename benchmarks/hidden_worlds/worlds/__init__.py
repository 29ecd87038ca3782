"""Worlds in which something is hidden: takes nothing from what it is made to test."""
