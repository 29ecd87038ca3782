"""Rows that cannot be measurements: times that go back, positions that jump, codes in place of readings."""
