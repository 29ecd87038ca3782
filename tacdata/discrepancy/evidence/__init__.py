"""Evidence: whitened columns, Gram matrices of presses, and models at their optimum."""
