"""A healthy machine as the model: how another one differs from it, named and sized in the readings' unit."""
