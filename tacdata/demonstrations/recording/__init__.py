"""Records demonstrations by hand."""
