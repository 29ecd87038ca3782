"""From a sensor's skin to quadratic tetrahedra, one step a file; `tacdata.skin.mesher` runs them."""
