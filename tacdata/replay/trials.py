"""Repeats one grasp or wipe over seeds, direct and compensated; each seed draws a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from scipy.stats import binomtest

import schemas
from tacdata import provenance
from tacdata.demonstrations.compensation import smallest_gain
from tacdata.demonstrations.demonstration import Demonstration
from tacdata.replay.grasp import cut, first_grasp
from tacdata.replay.outcome import ReplayOutcome, ball_centre, replay_targets
from tacdata.replay.scene import ReplayScene, drawn
from tacdata.replay.targets import FingertipTargets, targets_of

DIRECT = "direct"


class Trials:
    """The first grasp or wipe of a demonstration, ready for trials."""

    def __init__(self, made: Demonstration, gains: dict[str, dict[str, float]], scene: ReplayScene) -> None:
        """Cut it out and find where the object was.

        Args:
            made: A demonstration with predicted depth.
            gains: Kind of replay ("compensated", "chosen") -> finger -> gain [m/mm]; "direct" is added.
            scene: The undisturbed scene.

        Raises:
            UsageError: If it holds no grasp, or fingers lack predicted depth or gains.
        """
        self.made, self._scene = made, scene
        whole = targets_of(made, next(iter(gains.values())) if gains else dict.fromkeys(made.tracks, 0.0))
        self._span = first_grasp(whole)
        self.seen = cut(whole, self._span[0], self._span[2])
        self._centre = ball_centre(whole, self._span[1], scene.reach)
        self.paths = {DIRECT: self._cut(None), **{kind: self._cut(own) for kind, own in gains.items()}}

    def one(self, kind: str, scene: ReplayScene) -> ReplayOutcome:
        """Return the outcome of one trial, of a kind of replay, in a scene."""
        return replay_targets(self.paths[kind], scene, self._centre)

    def smallest_gain(self, wanted: float) -> float:
        """Return the smallest common gain [m/mm] at which every skin is pressed to a depth [mm] while holding.

        Raises:
            UsageError: If none reaches it.
        """

        def reached(gain: float) -> float:
            path = self._cut(dict.fromkeys(self.paths[DIRECT].fingers, gain))
            return min(replay_targets(path, self._scene, self._centre).depth.values())

        return smallest_gain(reached, wanted)

    def trials(self, seeds: int) -> list[dict[str, Any]]:
        """Run all trials of seeds 0, 1, ...; return them as plain data."""
        found = []
        for seed in range(seeds):
            world = drawn(self._scene, len(self.paths[DIRECT].fingers), seed)
            for kind in self.paths:
                end = self.one(kind, world)
                found.append(
                    {"recording": self.made.recording, "seed": seed, "kind": kind, "held": bool(end.held),
                     "lift": end.lift, "slip": end.slip, "force": end.force, "depth": end.depth}
                )  # fmt: skip
        return found

    def _cut(self, gains: dict[str, float] | None) -> FingertipTargets:
        return cut(targets_of(self.made, gains), self._span[0], self._span[2])


def result(
    tried: Sequence[Trials], seeds: int, scene: ReplayScene, chosen: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Return the result over recordings and seeds (`schemas/replay_result.schema.json`).

    Args:
        tried: One or more demonstrations.
        seeds: Trials of each kind and demonstration.
        scene: The undisturbed scene.
        chosen: Recording and depth for which the gain of the kind "chosen" was found.
    """
    found = [trial for one in tried for trial in one.trials(seeds)]
    kinds, first = list(tried[0].paths), tried[0]
    parents = {"recording": first.made.recording_hash, "checkpoint": (first.made.network or {}).get("hash", "")}
    gains = {kind: first.paths[kind].gains for kind in kinds if kind != DIRECT}
    return {
        "version": schemas.version("replay_result"), "recording": first.made.recording, "task": first.made.task,
        "gains": gains["compensated"],
        "scene": {**scene.document, "spreads": " ".join((drawn.__doc__ or "").split())},
        **{kind: rate([t for t in found if t["kind"] == kind]) for kind in kinds},
        "recordings": [
            {"name": one.made.recording, "hash": one.made.recording_hash,
             "rates": {
                 kind: rate([t for t in trials if t["kind"] == kind]) for kind in kinds
             }}
            for k, one in enumerate(tried) for trials in (found[k * seeds * len(kinds) : (k + 1) * seeds * len(kinds)],)
        ],
        **({"gain_chosen": {**chosen, "gains": gains["chosen"]}} if chosen else {}),
        "trials": found, "provenance": provenance.stamp("tacdata replay", parents, {"seeds": seeds}),
    }  # fmt: skip


def rate(trials: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the number of successes and trials, and Wilson's interval of the proportion, 95 %."""
    held = sum(trial["held"] for trial in trials)
    interval = binomtest(held, len(trials)).proportion_ci(method="wilson")
    return {"held": held, "of": len(trials), "wilson_95": list(interval)}
