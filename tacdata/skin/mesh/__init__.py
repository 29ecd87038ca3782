"""From a sensor to its mesh of quadratic tetrahedra."""
