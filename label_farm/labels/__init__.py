"""Labels of a session: requested, made, current or stale."""
