"""Linear algebra of a Newton step: factors, preconditioners, conjugate gradients."""
