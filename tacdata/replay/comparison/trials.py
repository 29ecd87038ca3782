"""Repeats one grasp or wipe over seeds, direct and compensated; each seed draws a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from scipy.stats import binomtest

import schemas
from tacdata import provenance
from tacdata.demonstrations.demonstration import Demonstration
from tacdata.replay.gain_search import FoundGain, GripDemand, GripSearch
from tacdata.replay.grasp import cut, first_grasp
from tacdata.replay.outcome import ReplayOutcome, object_centre, replay_targets
from tacdata.replay.scene import SPREADS, ReplayScene, drawn
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
        self._centre = object_centre(whole, self._span[1], scene.reach)
        self.paths = {DIRECT: self._cut(None), **{kind: self._cut(own) for kind, own in gains.items()}}

    def one(self, kind: str, scene: ReplayScene) -> ReplayOutcome:
        """Return the outcome of one trial, of a kind of replay, in a scene."""
        return replay_targets(self.paths[kind], scene, self._centre)

    def find_gain(self, demand: GripDemand) -> FoundGain:
        """Return the smallest common gain that meets a demand in scenes of its own, which no trial below has.

        Raises:
            UsageError: If none does.
        """
        fingers = self.paths[DIRECT].fingers

        def outcome(gain: float, seed: int) -> ReplayOutcome:
            path = self._cut(dict.fromkeys(fingers, gain))
            return replay_targets(path, drawn(self._scene, len(fingers), seed), self._centre)

        return GripSearch(outcome, demand).find()

    def trials(self, seeds: int) -> list[dict[str, Any]]:
        """Run all trials of seeds 0, 1, ...; return them as plain data."""
        found = []
        for seed in range(seeds):
            world = drawn(self._scene, len(self.paths[DIRECT].fingers), seed)
            for kind in self.paths:
                end = self.one(kind, world)
                found.append(
                    {
                        "recording": self.made.recording,
                        "seed": seed,
                        "kind": kind,
                        "held": bool(end.held),
                        "reason": end.reason,
                        "decided": end.decided,
                        "lift": end.lift,
                        "slip": end.slip,
                        "behind": end.behind,
                        "grip": end.grip,
                        "force": end.force,
                        "depth": end.depth,
                    }
                )
        return found

    def _cut(self, gains: dict[str, float] | None) -> FingertipTargets:
        return cut(targets_of(self.made, gains), self._span[0], self._span[2])


def result(
    tried: Sequence[Trials], seeds: int, scene: ReplayScene, chosen: tuple[Demonstration, FoundGain] | None = None
) -> dict[str, Any]:
    """Return the result over recordings and seeds (`schemas/replay_result.schema.json`).

    Args:
        tried: One or more demonstrations.
        seeds: Trials of each kind and demonstration.
        scene: The undisturbed scene.
        chosen: Demonstration on which the gain of the kind "chosen" was found, and that gain.
    """
    found = [trial for one in tried for trial in one.trials(seeds)]
    kinds, first = list(tried[0].paths), tried[0]
    parents = {"recording": first.made.recording_hash, "checkpoint": (first.made.network or {}).get("hash", "")}
    gains = {kind: first.paths[kind].gains for kind in kinds if kind != DIRECT}
    return {
        "version": schemas.version("replay_result"),
        "recording": first.made.recording,
        "task": first.made.task,
        "gains": gains["compensated"],
        "scene": {**scene.document, "spreads": SPREADS},
        **{kind: rate([t for t in found if t["kind"] == kind]) for kind in kinds},
        "recordings": [
            {
                "name": one.made.recording,
                "hash": one.made.recording_hash,
                "rates": {kind: rate([t for t in trials if t["kind"] == kind]) for kind in kinds},
            }
            for k, one in enumerate(tried)
            for trials in (found[k * seeds * len(kinds) : (k + 1) * seeds * len(kinds)],)
        ],
        **({"gain_chosen": _chosen(*chosen, gains["chosen"])} if chosen else {}),
        "trials": found,
        "provenance": provenance.stamp("tacdata replay", parents, {"seeds": seeds}),
    }


def _chosen(made: Demonstration, found: FoundGain, gains: dict[str, float]) -> dict[str, Any]:
    return {"recording": made.recording, "hash": made.recording_hash, "gains": gains, **found.document}


def rate(trials: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the number of successes and trials, and Wilson's interval of the proportion, 95 %."""
    held = sum(trial["held"] for trial in trials)
    interval = binomtest(held, len(trials)).proportion_ci(method="wilson")
    return {"held": held, "of": len(trials), "wilson_95": list(interval)}
