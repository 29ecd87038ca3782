"""A camera's intrinsics from views of a ChArUco board."""
