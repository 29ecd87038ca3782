"""The study: eight positions, five repeats, three strategies (paper, Exp. 3); success rates and numbers of moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from scipy.stats import binomtest

from tacdata.grasping.centre import Maps
from tacdata.grasping.lift import Grip, lift, pressing
from tacdata.grasping.strategies import strategy as strategies
from tacdata.grasping.touch import Fingertip, FingertipSpread, OrangeTouch
from tacdata.grasping.trial import Approach, Protocol, approach
from tacdata.replay.scene import SPREADS

PLACES = (-7.0, -5.0, -3.0, -1.0, 1.0, 3.0, 5.0, 7.0)
"""Offsets of the orange from the gripper's middle [mm]: evenly over the pad's 16 mm; Pos. 1 to 8."""
EDGE = (1, 2, 7, 8)
"""Positions that count as edge contact (paper)."""
OTHER_FORCES = 1.6, 2.2
"""Other forces of the lift on a centred orange for which the rates are given [N]; at 1.5 N its weight just slips."""
PUBLISHED = {
    "source": "paper, Exp. 3",
    "overall": {"contact_only": [15, 40], "raw_taxel": [27, 40], "dense_depth": [35, 40]},
    "edge": {"contact_only": [4, 20], "raw_taxel": [9, 20], "dense_depth": [17, 20]},
    "adjustments": {"raw_taxel": [1.07, 1.36], "dense_depth": [2.14, 1.24]},
    "edge_adjustments": {"raw_taxel": [2.56, 1.01], "dense_depth": [2.71, 1.21]},
}
"""Results of the paper: successes and trials; mean and standard deviation of adjustments where held."""


def strategy_names() -> list[str]:
    """Return all strategies, those of the paper first, in its order."""
    available, published = strategies.names(), list(PUBLISHED["overall"])
    return [*(name for name in published if name in available), *(name for name in available if name not in published)]


@dataclass(frozen=True)
class Disorder:
    """Random variation between trials."""

    place: float = 0.5
    """Largest offset of the orange from its position, sideways and in height [mm]."""
    friction: float = SPREADS["friction"]["half_width"] / 3**0.5
    """Standard deviation of the friction, as of objects of `tacdata replay` [1]."""
    mass: float = SPREADS["mass"]["half_width"] / 3**0.5
    """Standard deviation of the mass, likewise [1]."""


@dataclass(frozen=True)
class Setup:
    """Everything that decides a study, except the network."""

    protocol: Protocol = field(default_factory=Protocol)
    grip: Grip = field(default_factory=Grip)
    spread: FingertipSpread = field(default_factory=FingertipSpread)
    disorder: Disorder = field(default_factory=Disorder)
    repeats: int = 5
    """Trials at each place."""
    seed: int = 0
    """Seed of every draw."""

    @property
    def document(self) -> dict[str, Any]:
        """The setup as plain data."""
        return {"places": list(PLACES), "edge": list(EDGE), **asdict(self), "grip": self.grip.document}


@dataclass(frozen=True)
class GraspTrial:
    """One trial and its result."""

    strategy: str
    position: int
    """1 to 8."""
    repeat: int
    friction: float
    """Friction drawn [1]."""
    mass: float
    """Mass drawn [kg]."""
    vertical: float
    """Height of the orange's centre over the pads' middle [mm]."""
    approach: Approach
    held: bool

    @property
    def document(self) -> dict[str, Any]:
        """The trial as plain data."""
        way = self.approach
        return {
            "strategy": self.strategy,
            "position": self.position,
            "repeat": self.repeat,
            "held": self.held,
            "adjustments": way.adjustments,
            "left_at": way.lateral,
            "stopped": way.stopped,
            "estimates": list(way.estimates),
            "truths": list(way.truths),
        }


def trials(
    setup: Setup, touch: OrangeTouch, maps: Maps, progress: Callable[[int, int], None] = lambda done, of: None
) -> list[GraspTrial]:
    """Run every trial; strategies meet the same oranges, fingertips and noise.

    Args:
        setup: The study; its grip is the lifting configuration.
        touch: The skin's answer to the orange.
        maps: The trained network.
        progress: Called with the number of trials done and in total.
    """
    outcomes: list[GraspTrial] = []
    names = strategy_names()
    total = len(names) * len(PLACES) * setup.repeats
    for name in names:
        strategy = strategies.create(name, touch.sensor, maps)
        for position, place in enumerate(PLACES, 1):
            for repeat in range(setup.repeats):
                # Without the strategy's name, so that every strategy meets the same world.
                world = np.random.default_rng([setup.seed, position, repeat])
                aside, up = world.uniform(-setup.disorder.place, setup.disorder.place, 2).tolist()
                friction = setup.grip.friction * float(1 + setup.disorder.friction * world.standard_normal())
                mass = setup.grip.mass * float(1 + setup.disorder.mass * world.standard_normal())
                # Two fingertips differ by their own draws, the same for every strategy.
                fingers = [
                    Fingertip(touch, setup.spread, side, np.random.default_rng([setup.seed, position, repeat, k]))
                    for k, side in enumerate((1, -1))
                ]
                way = approach(fingers, place + aside, up, strategy, setup.protocol, touch.sensor.taxels.rate, world)
                trial = GraspTrial(name, position, repeat, friction, mass, up, way, False)
                outcomes.append(replace(trial, held=lifted(trial, setup.grip)))
                progress(len(outcomes), total)
    return outcomes


def lifted(trial: GraspTrial, grip: Grip) -> bool:
    """Return whether a lifting configuration holds the orange of a trial."""
    if trial.approach.stopped:
        return False
    configuration = replace(grip, friction=trial.friction, mass=trial.mass)
    return lift(configuration, trial.approach.lateral / 1000, trial.vertical / 1000).held


def configured(setup: Setup, force: float | None = None) -> Setup:
    """Return the setup whose lift presses a centred orange with a force [N]; by default the one it measures with."""
    # The lift starts from a centred orange; off the middle the same squeeze presses less.
    return replace(setup, grip=pressing(setup.grip, setup.protocol.force if force is None else force))


def rates(outcomes: list[GraspTrial]) -> dict[str, Any]:
    """Return success and adjustments of every strategy: overall, at the edge and at each position."""
    return {name: _rates([t for t in outcomes if t.strategy == name]) for name in strategy_names()}


def _rates(outcomes: list[GraspTrial]) -> dict[str, Any]:
    edge = [t for t in outcomes if t.position in EDGE]
    positions = sorted({t.position for t in outcomes})
    return {
        "overall": _share(outcomes),
        "edge": _share(edge),
        "by_position": {str(p): _share([t for t in outcomes if t.position == p]) for p in positions},
        "adjustments": _moves(outcomes),
        "edge_adjustments": _moves(edge),
        "safety_stops": sum("safety" in t.approach.stopped for t in outcomes),
    }


def _share(outcomes: list[GraspTrial]) -> dict[str, Any]:
    successes = sum(t.held for t in outcomes)
    interval = binomtest(successes, len(outcomes)).proportion_ci(method="wilson")
    return {"held": successes, "of": len(outcomes), "wilson_95": list(interval)}


def _moves(outcomes: list[GraspTrial]) -> dict[str, Any]:
    """Return mean and standard deviation of the adjustments where the orange was held, as in the paper."""
    moves = [t.approach.adjustments for t in outcomes if t.held]
    if not moves:
        return {"mean": None, "sd": None}
    return {"mean": float(np.mean(moves)), "sd": float(np.std(moves, ddof=1)) if len(moves) > 1 else 0.0}
