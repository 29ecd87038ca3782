"""AprilTags found in an image."""
