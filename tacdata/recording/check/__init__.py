"""Checks whether a recording or a session is fit to be labelled and learned from."""
