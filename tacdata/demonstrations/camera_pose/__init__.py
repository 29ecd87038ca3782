"""Where a camera stands in the world."""
