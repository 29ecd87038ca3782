"""A network's scores: the paper's table, protocols, successes."""
