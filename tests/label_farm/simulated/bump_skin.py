"""A stand-in for the skin models of simulated specimens, and a small plan of simulated presses."""

from dataclasses import replace

import numpy as np
from fast_model import path

from tacdata.errors import SolveError
from tacdata.label_farm.simulated.swallowed_shape import underside

SMALL = {
    "version": "1.0",
    "name": "small",
    "shapes": {"sphere": {"shape": "sphere", "radius": [2.0, 4.0]}},
    "depth": [0.3, 0.5],
    "speed": [1.0, 2.0],
    "hold": 0.2,
    "rest": 0.3,
    "recovery": 0.1,
    "specimens": {"count": 2, "gain": 0.1, "offset": 100.0, "parameters": {"modulus": 0.1}},
    "noise": {"readings": 0.0, "drift": 0.0, "quantum": 1.0},
    "mesh": {"outer": 1.6, "interior": 3.0, "protrusion": 1.4, "tip": None},
}


class BumpSkin:
    """Stands in for the skin model of a specimen: answers at once, with a bump times the depth."""

    content_hash = "ab" * 32
    swallows = False

    def __init__(self, sensor, widest=3.9, share=0.1):
        self.sensor, self.identity, self.widest, self.share = sensor, {"sensor": "bump"}, widest, share

    def solve_many(self, requests, capacity):
        for number, request in enumerate(requests):
            if request.indenter.extent > self.widest:
                yield number, SolveError("no equilibrium at state 3", "convergence", "reduce the depth")
            else:
                yield number, self.pressed(request)

    def pressed(self, request):
        """The bump, and under the shape the shape: no skin lies above what presses it."""
        found = path(self.sensor, request.depths, lambda d: self.share * d, request.x)
        under = found.depth[:, None, None] - underside(request, self.sensor)
        return found if self.swallows else replace(found, surface=np.maximum(found.surface, under))
