"""The import wizard: a page on which a person assigns columns to quantities."""
