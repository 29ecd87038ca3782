"""Internal forces and stiffness of the skin's body, as Warp kernels."""
