"""Looking at foreign files first: what is in them, and a mapping to start from, with questions."""
