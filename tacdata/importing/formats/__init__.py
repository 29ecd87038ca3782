"""File formats that foreign recordings may come in, one file each."""
