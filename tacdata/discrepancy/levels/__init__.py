"""Names beside a flexible remainder, by levels: family, mechanism, form."""
