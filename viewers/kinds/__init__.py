"""Kinds of viewable files, one a file."""
