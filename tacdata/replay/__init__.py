"""What a robot is to do with a demonstration: fingertip targets, joints, and a scene to try them in."""
