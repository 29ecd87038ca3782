"""Noise, nuisances and offsets: the null model that effects are tested against."""
