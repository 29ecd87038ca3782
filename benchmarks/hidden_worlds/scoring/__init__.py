"""Comparison of verdicts with the truth: the only code that opens both."""
