"""Building blocks of material laws: kinematics, invariants, principal axes."""
