"""Memory of a pressed layer, stepped in time: each class turns the load of an elastic layer into its own.

`begin` is called before every run, `load` for every step with the layer, its indentation and the one before [mm]; it
returns a load [N].
"""

from math import erf, exp

import numpy as np
from path import STEP


class Relaxation:
    """Load relaxes in several terms."""

    def __init__(self, terms):
        """Take terms of (share [1], time constant [s])."""
        self.shares = [share for share, _ in terms]
        self.kept = [exp(-STEP / tau) for _, tau in terms]
        self.lasting = 1 - sum(self.shares)

    def begin(self, place):
        """Clear the state."""
        self.parts = [0.0] * len(self.shares)

    def load(self, layer, depth, before):
        """Return the load that is left [N]."""
        elastic = layer.elastic(depth)
        rise = elastic - layer.elastic(before)
        load = elastic * self.lasting
        for j, (share, kept) in enumerate(zip(self.shares, self.kept, strict=True)):
            self.parts[j] = self.parts[j] * kept + share * rise * kept**0.5
            load += self.parts[j]
        return load


def spectrum(total, shortest, longest, count):
    """Return terms of equal share whose times are spaced evenly by their logarithms: nearly a power law."""
    times = np.geomspace(shortest, longest, count)
    shares = np.ones(count)
    return tuple(zip(total * shares / shares.sum(), times, strict=True))


class Friction:
    """Part of the load is carried by elements that each slip at a load of its own (Prandtl); they forget in the air."""

    SLIPS = (0.02, 0.04, 0.08, 0.14, 0.25, 0.4)
    """Over the largest load [1]."""

    def __init__(self, total, largest):
        """Take how much of the load it is: each of six elements carries a third of `total`; the largest load [N]."""
        self.share = total / 6 * 2
        self.slips = [slip * largest for slip in self.SLIPS]
        self.rest = 1 - self._sum([self.share for _ in self.slips])

    @staticmethod
    def _sum(values):
        # Added one by one: sum() compensates for rounding, which would change the last digits of the recordings.
        total = 0.0
        for value in values:
            total += value
        return total

    def begin(self, place):
        """Clear the state."""
        self.stops = [0.0] * len(self.slips)

    def load(self, layer, depth, before):
        """Return the load with that of the elements [N]."""
        elastic = layer.elastic(depth)
        rise = elastic - layer.elastic(before)
        self.stops = [min(max(stop + rise, -slip), slip) for stop, slip in zip(self.stops, self.slips, strict=True)]
        if depth <= 0:
            self.begin(None)
            return 0.0
        return elastic * self.rest + self._sum([self.share * stop for stop in self.stops])


class SmoothFriction:
    """Friction that yields smoothly (Bouc-Wen)."""

    FORGETS = 0.02
    """Time constant in the air [s]."""
    FULL = 0.5
    """Depth from which on it has its whole size [mm]."""
    PARTS = 4
    """Of a step of time."""

    def __init__(self, size, travel, power):
        """Take its size [N], the travel in which it yields [mm] and how sharply [1]."""
        self.size, self.travel, self.power = size, travel, power

    def begin(self, place):
        """Clear the state."""
        self.state = 0.0

    def load(self, layer, depth, before):
        """Return the load with it [N]."""
        move = ((depth - before) if depth > 0 else 0.0) / self.PARTS
        for _ in range(self.PARTS):
            yielding = abs(self.state) ** self.power * (0.5 + 0.5 * np.sign(move * self.state))
            self.state += move / self.travel * (1 - yielding)
        if depth <= 0:
            self.state *= exp(-STEP / self.FORGETS)
        return layer.elastic(depth) + self.size * self.state * min(1.0, max(0.0, depth) / self.FULL)


class Network:
    """A second, parallel network flows faster the more it carries (Bergström and Boyce)."""

    FASTEST = 400.0
    """Its flow at most, over `rate` [1]."""
    PARTS = 4
    """Of a step of time."""

    def __init__(self, stiffness, strength, rate, power):
        """Take its stiffness [N/mm], strength [N/mm], rate of flow [mm/s] and the power of load over strength [1]."""
        self.stiffness, self.strength, self.rate, self.power = stiffness, strength, rate, power

    def begin(self, place):
        """Clear the state."""
        self.flowed = 0.0

    def load(self, layer, depth, before):
        """Return the load of both networks [N]."""
        pressed = max(depth, 0.0)
        for _ in range(self.PARTS):
            carried = self.stiffness * (pressed - self.flowed)
            speed = min((abs(carried) / (self.strength * (0.2 + pressed))) ** self.power, self.FASTEST)
            self.flowed += STEP / self.PARTS * self.rate * np.sign(carried) * speed
        return layer.elastic(depth) + self.stiffness * (pressed - self.flowed)


class Softening:
    """A layer is softer below the most energy that it ever took at a place (Mullins, as Ogden and Roxburgh)."""

    def __init__(self, ease, threshold, spread):
        """Take r [1], m [mJ] and beta [1] of the pseudo-elastic law."""
        self.ease, self.threshold, self.spread = ease, threshold, spread
        self.most = {}

    def begin(self, place):
        """Go on with the state of the place."""
        self.place = place

    def load(self, layer, depth, before):
        """Return the load [N], and keep the most energy."""
        energy = layer.energy(depth)
        most = self.most[self.place] = max(self.most.get(self.place, 0.0), energy)
        return layer.elastic(depth) * (1 - erf((most - energy) / (self.threshold + self.spread * most)) / self.ease)
