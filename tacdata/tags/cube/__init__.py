"""A cube of AprilTags and its pose in an image."""
