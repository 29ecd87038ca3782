"""Physical effects that a model of a sensor may lack, one a file."""

from tacdata.effects.effect import BASE, ROOM, Effect, Parameter, Placed, library, load

__all__ = ["BASE", "ROOM", "Effect", "Parameter", "Placed", "library", "load"]
