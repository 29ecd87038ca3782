"""The files and columns of a LeRobot v3.0 folder."""
