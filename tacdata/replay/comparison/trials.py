"""Repeats one grasp or wipe over seeds, direct and compensated; each seed draws a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import binomtest

from tacdata import provenance, schemas
from tacdata.demonstrations.demonstration import Demonstration
from tacdata.replay.comparison.arms import CONTROLS, DEPTH, DIRECT, TAXELS, control_arms
from tacdata.replay.comparison.challenges import CHALLENGES, changed
from tacdata.replay.comparison.depth_feedback import DepthFeedback
from tacdata.replay.comparison.gain_search import FoundGain, GripDemand, GripSearch
from tacdata.replay.comparison.linked_hand import LinkedHand
from tacdata.replay.comparison.paired import worth
from tacdata.replay.grasp import ObjectPlace, cut, felt_place, first_grasp, touched
from tacdata.replay.outcome import ReplayOutcome, replay_targets
from tacdata.replay.robot import Robot
from tacdata.replay.scene import SPREADS, ReplayScene, drawn
from tacdata.replay.targets import FingertipTargets, targets_of

CHOSEN, CLOSED, CLOSED_RAW = "chosen", "closed loop", "closed loop, raw"
"""Kinds of replay with a gain that was searched for, and with depth or readings fed back while the robot presses."""
PUBLISHED = {"grasp": (0.0, 0.9167), "wipe": (0.0, 0.90)}
"""Shares of direct and of compensated replays that succeeded in the paper, by task [1] (Exp. 2)."""
ALIKE = 0.1
"""Largest difference from the paper's shares at which a stiffness is like its hand's [1]."""
STIFFNESSES = 150.0, 300.0, 1000.0, 3000.0
"""Stiffnesses of a sweep [N/m]; that of the paper's hand, a LinkerHand O20, is not published."""


class Trials:
    """The first grasp or wipe of a demonstration, ready for trials."""

    def __init__(
        self,
        demonstration: Demonstration,
        gains: dict[str, dict[str, float]],
        scene: ReplayScene,
        robot: Robot | None = None,
        place: ObjectPlace | None = None,
    ) -> None:
        """Cut it out and place the object.

        Args:
            demonstration: A demonstration with predicted depth.
            gains: Kind of replay ("compensated", "chosen") -> finger -> gain [m/mm]; "direct" is added.
            scene: The undisturbed scene.
            robot: Replays through its joints, with the fingers that it has; by default pads without links.
            place: Where the object is known to be; by default from the readings' first touch.

        Raises:
            UsageError: If it holds no grasp, or fingers lack readings, predicted depth or gains.
        """
        self.made, self._scene, self.robot = demonstration, scene, robot
        self._names = tuple(name for name in demonstration.tracks if robot is None or name in robot.tips)
        self._hands: dict[str, LinkedHand] = {}
        usual = next(iter(gains.values())) if gains else dict.fromkeys(demonstration.tracks, 0.0)
        targets = targets_of(demonstration, usual, self._names)
        self._span = first_grasp(targets)
        self.seen = cut(targets, self._span[0], self._span[2])
        self.place = place or felt_place(targets, self._span[1], scene.reach)
        self.paths = {DIRECT: self._cut(None)}
        if DEPTH in gains:
            depth_targets = self._cut(gains[DEPTH])
            self.paths |= {**control_arms(self.paths[DIRECT], depth_targets), DEPTH: depth_targets}
        self.paths |= {kind: self._cut(values) for kind, values in gains.items() if kind != DEPTH}

    def one(self, kind: str, scene: ReplayScene, seed: int = 0) -> ReplayOutcome:
        """Return the outcome of one trial, of a kind of replay, in a scene; the seed draws a controller's errors."""
        followed = {CLOSED: DEPTH, CLOSED_RAW: TAXELS}.get(kind, kind)
        path, hand = self.paths[followed], self._hand(followed)
        if kind == followed:
            return replay_targets(path, scene, self.place.centre, hand=hand)
        goal = np.clip(np.nan_to_num(path.depth), 0, None) / 1000
        if kind == CLOSED_RAW:
            # One gain for all units: the information of a reading without a network of its own.
            level, _ = touched(path)
            goal = level * (goal.sum() / max(float(level.sum()), 1e-9))
        seconds = (path.time_ns - path.time_ns[0]) * 1e-9
        # Of the undisturbed scene: the controller does not know the drawn one.
        softness = 1 + self._scene.skin / (self._scene.stiffness if hand is None else hand.stiffness)
        controller = DepthFeedback(goal, seconds, path.normals, softness, seed, kind == CLOSED_RAW)
        return replay_targets(path, scene, self.place.centre, controller.shift, hand)

    def held_in(
        self, scene: ReplayScene, kinds: Sequence[str], seeds: int, challenge: str = ""
    ) -> dict[str, list[bool]]:
        """Return the outcomes of each kind in the scenes of seeds 0, 1, ... about a scene.

        Args:
            scene: The undisturbed scene.
            kinds: Kinds of replay.
            seeds: Number of scenes.
            challenge: One of `CHALLENGES`, which changes each scene; none for the scenes as drawn.
        """
        outcomes: dict[str, list[bool]] = {kind: [] for kind in kinds}
        limit = scene.body.strength if challenge and CHALLENGES[challenge].fragile else np.inf
        for seed in range(seeds):
            world = self._drawn(scene, seed)
            world = changed(challenge, world, seed) if challenge else world
            for kind in kinds:
                end = self.one(kind, world, seed)
                outcomes[kind].append(bool(end.held) and end.hardest <= limit)
        return outcomes

    def _drawn(self, scene: ReplayScene, seed: int) -> ReplayScene:
        return drawn(scene, len(self.seen.fingers), seed, self.place.spread)

    def find_gain(self, demand: GripDemand) -> FoundGain:
        """Return the smallest common gain that meets a demand in scenes of its own, which no trial below has.

        Raises:
            UsageError: If none does.
        """
        fingers = self.paths[DIRECT].fingers
        hands: dict[float, LinkedHand] = {}

        def outcome(gain: float, seed: int) -> ReplayOutcome:
            path = self._cut(dict.fromkeys(fingers, gain))
            if self.robot is not None and gain not in hands:
                hands[gain] = LinkedHand(self.robot, path, self._scene)
            return replay_targets(path, self._drawn(self._scene, seed), self.place.centre, hand=hands.get(gain))

        return GripSearch(outcome, demand).find()

    def trials(self, seeds: int) -> list[dict[str, Any]]:
        """Run all trials of seeds 0, 1, ...; return them as plain data."""
        records = []
        for seed in range(seeds):
            world = self._drawn(self._scene, seed)
            for kind in self.paths:
                end = self.one(kind, world, seed)
                records.append(
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
        return records

    def _hand(self, kind: str) -> LinkedHand | None:
        """Return the joints that follow an arm's path; None without a robot."""
        if self.robot is not None and kind not in self._hands:
            self._hands[kind] = LinkedHand(self.robot, self.paths[kind], self._scene)
        return self._hands.get(kind)

    def _cut(self, gains: dict[str, float] | None) -> FingertipTargets:
        return cut(targets_of(self.made, gains, self._names), self._span[0], self._span[2])


def result(
    tried: Sequence[Trials], seeds: int, scene: ReplayScene, selection: tuple[Demonstration, FoundGain] | None = None
) -> dict[str, Any]:
    """Return the result over recordings and seeds (`schemas/replay_result.schema.json`).

    Args:
        tried: One or more demonstrations.
        seeds: Trials of each kind and demonstration.
        scene: The undisturbed scene.
        selection: Demonstration on which the gain of the kind "chosen" was found, and that gain.
    """
    records = [trial for recording in tried for trial in recording.trials(seeds)]
    kinds, first = list(tried[0].paths), tried[0]
    parents = {"recording": first.made.recording_hash, "checkpoint": (first.made.network or {}).get("hash", "")}
    gains = {kind: first.paths[kind].gains for kind in kinds if kind in (DEPTH, CHOSEN)}
    outcomes = {kind: [t["held"] for t in records if t["kind"] == kind] for kind in kinds}
    return {
        "version": schemas.version("replay_result"),
        "recording": first.made.recording,
        "task": first.made.task,
        "gains": gains[DEPTH],
        "scene": {**scene.document, "spreads": SPREADS},
        **({"robot": first.robot.document} if first.robot else {}),
        **{kind: rate(outcomes[kind]) for kind in kinds if kind not in CONTROLS},
        "controls": {kind: rate(outcomes[kind]) for kind in kinds if kind in CONTROLS},
        "worth": worth(outcomes[DEPTH], {kind: outcomes[kind] for kind in kinds if kind in CONTROLS}),
        "recordings": [
            {
                "name": recording.made.recording,
                "hash": recording.made.recording_hash,
                "object": recording.place.document,
                "rates": {kind: rate([t["held"] for t in trials if t["kind"] == kind]) for kind in kinds},
            }
            for k, recording in enumerate(tried)
            for trials in (records[k * seeds * len(kinds) : (k + 1) * seeds * len(kinds)],)
        ],
        **({"gain_chosen": _chosen(*selection, gains[CHOSEN])} if selection else {}),
        "trials": records,
        "provenance": provenance.stamp("tacdata replay", parents, {"seeds": seeds}),
    }


def _chosen(demonstration: Demonstration, selection: FoundGain, gains: dict[str, float]) -> dict[str, Any]:
    return {
        "recording": demonstration.recording,
        "hash": demonstration.recording_hash,
        "gains": gains,
        **selection.document,
    }


def rate(outcomes: Sequence[bool]) -> dict[str, Any]:
    """Return the number of successes and trials, and Wilson's interval of the proportion, 95 %."""
    interval = binomtest(sum(outcomes), len(outcomes)).proportion_ci(method="wilson")
    return {"held": sum(outcomes), "of": len(outcomes), "wilson_95": list(interval)}


def sweep(tried: Sequence[Trials], scene: ReplayScene, seeds: int) -> list[dict[str, Any]]:
    """Return the outcomes of each arm at each of `STIFFNESSES`, as plain data, with the benefit of depth there."""
    kinds = list(tried[0].paths)
    return [
        _row(
            {"stiffness": value},
            [recording.held_in(replace(scene, stiffness=value), kinds, seeds) for recording in tried],
        )
        for value in STIFFNESSES
    ]


def challenged(tried: Sequence[Trials], scene: ReplayScene, seeds: int) -> list[dict[str, Any]]:
    """Return the outcomes of each arm and of the closed loop in each of `CHALLENGES`, as plain data."""
    kinds = [*tried[0].paths, CLOSED_RAW, CLOSED]
    return [
        _row({"challenge": name}, [recording.held_in(scene, kinds, seeds, name) for recording in tried])
        for name in CHALLENGES
    ]


def _row(named: dict[str, Any], each: Sequence[dict[str, list[bool]]]) -> dict[str, Any]:
    outcomes = {kind: [hit for results in each for hit in results[kind]] for kind in each[0]}

    def against(kinds: Sequence[str], what: str = "depth") -> str:
        judged = CLOSED if CLOSED in outcomes else DEPTH
        return worth(outcomes[judged], {kind: outcomes[kind] for kind in kinds if kind in outcomes}, what)

    # Depth is compared in the same loop, and the loop with the arms that only move.
    words = [against(CONTROLS)] if CLOSED not in outcomes else []
    words += [against((CLOSED_RAW,))] if CLOSED_RAW in outcomes else []
    words += [against((*CONTROLS, DEPTH), "the loop")] if CLOSED in outcomes else []
    rates = {kind: rate(values) for kind, values in outcomes.items()}
    return {**named, "rates": rates, "worth": "; ".join(words)}


def like_published(row: dict[str, Any], task: str) -> bool:
    """Return whether direct and compensated replays of a row of a sweep succeed as often as the paper's."""
    if task not in PUBLISHED:
        return False
    shares = [row["rates"][kind]["held"] / row["rates"][kind]["of"] for kind in (DIRECT, DEPTH)]
    return all(abs(share - reference) <= ALIKE for share, reference in zip(shares, PUBLISHED[task], strict=True))
