"""What material laws are built from: kinematics, invariants, principal axes."""
