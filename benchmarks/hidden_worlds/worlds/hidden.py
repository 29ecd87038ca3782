"""Registry of hidden effects: one function each, entered here with its names and where it acts."""

from collections.abc import Callable
from dataclasses import dataclass, field

STAGES = ("simulator", "guide", "mounting", "layer", "skin", "taxel", "readout", "timing")
"""Order in which they act."""


@dataclass(frozen=True)
class Hidden:
    """One thing that may be true of a world and is not in the lab's model."""

    name: str
    stage: str
    act: Callable
    """Changes the world, given a size [1]; size 1 would not surprise a lab."""
    called: tuple[str, ...]
    """Names that a verdict may rightly give it; empty if no library is expected to hold it."""
    group: str
    """The effect's appearance in the readings."""
    most: float
    """Largest physical size [1]."""
    needs: dict = field(default_factory=dict)
    """Settings of a world without which it does not show."""
    fitted: bool = False
    """Whether it shows against a response without memory that was fitted to the recordings."""
    both: bool = False
    """Whether it may be of negative size: lengths, gains and clocks are off either way, no skin relaxes backwards."""


KNOWN: dict[str, Hidden] = {}
"""Name -> hidden effect."""


def hidden(stage, group, called=None, most=10.0, fitted=False, needs=None, both=False):
    """Enter a function; it is called by its own name unless ``called`` is given."""

    def enter(act):
        name = act.__name__
        names = (name,) if called is None else tuple(called)
        KNOWN[name] = Hidden(name, stage, act, names, group, most, needs or {}, fitted, both)
        return act

    return enter
