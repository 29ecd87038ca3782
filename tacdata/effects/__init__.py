"""Physical effects that a model of a sensor may lack, one a file."""

from tacdata.effects.effect import (
    BASE,
    ROOM,
    AtRest,
    Effect,
    Family,
    GainKind,
    Growth,
    LikeGain,
    Parameter,
    Placed,
    Scale,
    Whole,
    library,
    load,
)

__all__ = [
    "BASE",
    "ROOM",
    "AtRest",
    "Effect",
    "Family",
    "GainKind",
    "Growth",
    "LikeGain",
    "Parameter",
    "Placed",
    "Scale",
    "Whole",
    "library",
    "load",
]
