"""The report: what the posterior allows to be stated, and how it is written."""
