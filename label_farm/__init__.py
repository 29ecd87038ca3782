"""The label farm: which labels are wanted, who computes them, and where they lie."""
