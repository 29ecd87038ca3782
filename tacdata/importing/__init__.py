"""Foreign data become recordings, by a mapping file; what is missing stays missing."""
