"""The deformed outer face as a depth map."""
