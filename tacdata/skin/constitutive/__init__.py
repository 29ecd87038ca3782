"""What material laws are built from and judged by: kinematics, principal axes, evaluation, stability, Prony series."""
