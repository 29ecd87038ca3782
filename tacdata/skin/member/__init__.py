"""Properties of each batch member: constants, indenter, pose."""
