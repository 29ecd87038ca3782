"""Many trials of one grasp, direct and compensated, each seed a world of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import schemas
from tacdata import provenance
from tacdata.demonstrations.compensation import smallest_gain
from tacdata.demonstrations.demonstration import Demonstration
from tacdata.replay.grasp import cut, first_grasp
from tacdata.replay.scene import Outcome, Scene, ball_centre, drawn, replay_targets
from tacdata.replay.targets import Targets, targets_of

KINDS = ("direct", "compensated")


class Trials:
    """The first grasp of a demonstration, to be tried."""

    def __init__(self, made: Demonstration, gains: dict[str, float], scene: Scene) -> None:
        """Cut the grasp out and find where the ball lay.

        Args:
            made: A demonstration with predicted depth.
            gains: Finger -> gain [m/mm].
            scene: The undisturbed world.

        Raises:
            UsageError: If it holds no grasp, or fingers lack predicted depth or gains.
        """
        self._made, self._gains, self._scene = made, gains, scene
        whole = targets_of(made, gains)
        self._span = first_grasp(whole)
        self._centre = ball_centre(whole, self._span[1], scene.radius)
        self._paths = {"direct": self._cut(None), "compensated": self._cut(gains)}

    def one(self, kind: str, scene: Scene) -> Outcome:
        """Return the outcome of one trial, "direct" or "compensated", in a scene."""
        return replay_targets(self._paths[kind], scene, self._centre)

    def smallest_gain(self, wanted: float) -> float:
        """Return the smallest common gain [m/mm] with which every skin is pressed to a depth [mm] while holding.

        Raises:
            UsageError: If none reaches it.
        """

        def reached(gain: float) -> float:
            path = self._cut(dict.fromkeys(self._paths["direct"].fingers, gain))
            return min(replay_targets(path, self._scene, self._centre).depth.values())

        return smallest_gain(reached, wanted)

    def run(self, seeds: int, interval: Callable[[int, int], tuple[float, float]]) -> dict[str, Any]:
        """Return the result over seeds 0 ... (`schemas/replay_result.schema.json`).

        Args:
            seeds: Trials of each kind.
            interval: Successes and trials -> an interval of the proportion.
        """
        trials = []
        for seed in range(seeds):
            world = drawn(self._scene, len(self._paths["direct"].fingers), seed)
            for kind in KINDS:
                found = self.one(kind, world)
                trials.append(
                    {"seed": seed, "kind": kind, "held": bool(found.held), "lift": found.lift, "force": found.force,
                     "depth": found.depth}
                )  # fmt: skip
        rates = {}
        for kind in KINDS:
            held = sum(trial["held"] for trial in trials if trial["kind"] == kind)
            rates[kind] = {"held": held, "of": seeds, "wilson_95": list(interval(held, seeds))}
        parents = {"recording": self._made.recording_hash, "checkpoint": (self._made.network or {}).get("hash", "")}
        return {
            "version": schemas.version("replay_result"), "recording": self._made.recording, "task": self._made.task,
            "gains": {name: self._gains[name] for name in self._paths["direct"].fingers},
            "scene": {**self._scene.document, "spreads": " ".join((drawn.__doc__ or "").split())}, **rates,
            "trials": trials, "provenance": provenance.stamp("tacdata replay", parents, {"seeds": seeds}),
        }  # fmt: skip

    def _cut(self, gains: dict[str, float] | None) -> Targets:
        return cut(targets_of(self._made, gains), self._span[0], self._span[2])
