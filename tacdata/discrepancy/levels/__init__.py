"""Names despite a flexible remainder, by levels: family, mechanism, form."""
