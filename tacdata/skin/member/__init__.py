"""What each batch member is made of: constants, indenter, pose."""
