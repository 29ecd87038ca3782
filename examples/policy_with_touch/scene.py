"""Two fingertips feel for a hidden orange and lift it: scene, demonstrations by a strategy, their dataset."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tacdata.dataset.format.whole_dataset import write_whole
from tacdata.grasping.fingertip import fingertip_sensor
from tacdata.grasping.lift import lift
from tacdata.grasping.press_set import FOLDER, read_presses
from tacdata.grasping.strategies import strategy as strategies
from tacdata.grasping.study import Disorder, Setup, configured
from tacdata.grasping.touch import Fingertip, OrangeTouch
from tacdata.grasping.trial import fused

RATE, FRAMES = 10, 3
"""Steps a second [Hz]; readings at 30 Hz that a step averages [count]."""
FORCE = 0.6
"""Normal force of each fingertip while it feels [N]: light enough that friction at the table holds the orange."""
SPEED, LIMIT = 5.0, 40
"""Largest speed of the arm [mm/s]; steps after which the hand lifts wherever it is [count]."""
REACH, UNSURE, JITTER = 7.0, 0.03, 0.02
"""Largest initial offset of the orange [mm]; errors of the motor's force [N] and of a step of the arm [mm]."""
CENTRAL, TAIL = 0.5, 5
"""Estimated offset at which a demonstrator lifts [mm]; steps that repeat the last command [count]."""
FINGERS = {"far": 1, "near": -1}
"""Finger and the direction of its sensor's x in the gripper."""
STATE, CAMERA, ACTION = "observation.state", "observation.environment_state", "action"

Observation = dict[str, np.ndarray]
"""STATE: arm [mm], force [N], then the taxels of both fingers [counts]; CAMERA: the orange's place [mm], shape (2,)."""
Controller = Callable[[Observation], np.ndarray]
"""Observation -> speed of the arm [mm/s] and whether to lift (above 0.5), shape (2,)."""


class World:
    """What all trials share: the skin's answers, and the hand of the grasp study, which lifts with 1.8 N."""

    def __init__(self, camera: float) -> None:
        """Read the shipped presses.

        Args:
            camera: Standard deviation of the camera's error on each axis [mm].
        """
        self.sensor, self.camera, self.setup = fingertip_sensor(), camera, configured(Setup())
        self.touch = OrangeTouch(read_presses(FOLDER / "orange.npz", self.sensor), self.sensor)


class Trial:
    """One orange: its place is hidden; so are its mass, its friction and the fingertips' errors."""

    def __init__(self, world: World, seed: Sequence[int]) -> None:
        """Draw it; seeds that are equal give the same orange, whoever the controller is."""
        self._rng, disorder = np.random.default_rng([*seed, 0]), Disorder()
        self.place = float(self._rng.uniform(-REACH, REACH))
        self._vertical = float(self._rng.uniform(-disorder.place, disorder.place))
        grip, (a, b) = world.setup.grip, self._rng.standard_normal(2).tolist()
        self._grip = replace(
            grip, friction=grip.friction * (1 + disorder.friction * a), mass=grip.mass * (1 + disorder.mass * b)
        )
        self._camera = self._rng.normal((self.place, self._vertical), world.camera)
        self.fingers = [
            Fingertip(world.touch, world.setup.spread, side, np.random.default_rng([*seed, k]))
            for k, side in enumerate(FINGERS.values(), 1)
        ]
        self.arm, self.frames, self.sensor = 0.0, np.zeros(0), world.sensor

    def observe(self) -> Observation:
        """Return the next observation; it keeps the frames of each finger, shape (2, FRAMES, taxels)."""
        offset = self.place - self.arm
        self.frames = np.stack([finger.frames(offset, self._vertical, FORCE, FRAMES) for finger in self.fingers])
        force = FORCE + UNSURE * self._rng.standard_normal()
        return {
            STATE: np.concatenate([[self.arm, force], self.frames.mean(axis=1).ravel()]).astype(np.float32),
            CAMERA: self._camera.astype(np.float32),
        }

    def move(self, speed: float) -> None:
        """Move the arm for a step [mm/s]."""
        self.arm += float(np.clip(speed, -SPEED, SPEED)) / RATE + JITTER * self._rng.standard_normal()

    def held(self) -> bool:
        """Return whether the lift in MuJoCo holds the orange."""
        return lift(self._grip, (self.place - self.arm) / 1000, self._vertical / 1000).held


def run(trial: Trial, controller: Controller) -> tuple[bool, int, list[tuple[Observation, np.ndarray]]]:
    """Let a controller search and lift: whether the orange is held, the steps taken, and each one's record."""
    records: list[tuple[Observation, np.ndarray]] = []
    while len(records) < LIMIT:
        observation = trial.observe()
        records.append((observation, controller(observation)))
        speed, lifts = records[-1][1]
        if lifts > 0.5:
            break
        trial.move(speed)
    return trial.held(), len(records), records


def by_touch(trial: Trial, name: str) -> Controller:
    """Return a strategy of the grasp study: it moves toward the felt centre and lifts when it is central."""
    strategy = strategies.create(name, trial.sensor, maps=_no_network)

    def controller(_: Observation) -> np.ndarray:
        offset = fused(trial.fingers, [strategy.centre(frames) for frames in trial.frames])
        if offset is None:
            return np.array([0.0, 0.0])
        return np.array([0.0, 1.0] if abs(offset) <= CENTRAL else [np.clip(offset * RATE / 2, -SPEED, SPEED), 0.0])

    return controller


def by_camera(observation: Observation) -> np.ndarray:
    """Move to where the camera saw the orange, then lift."""
    offset = float(observation[CAMERA][0] - observation[STATE][0])
    return np.array([0.0, 1.0] if abs(offset) < 0.1 else [np.clip(offset * RATE, -SPEED, SPEED), 0.0])


def by_place(trial: Trial) -> Controller:
    """Move to the orange's true place, then lift: what no controller can beat."""

    def controller(observation: Observation) -> np.ndarray:
        return by_camera(observation | {CAMERA: np.array([trial.place, 0.0])})

    return controller


def _no_network(_: np.ndarray) -> np.ndarray:
    raise NotImplementedError("this example has no network: take raw_taxel or contact_only")


def demonstrate(world: World, episodes: int, seed: int) -> list[dict[str, np.ndarray]]:
    """Return demonstrations that held their orange, by raw taxels: columns, frames first."""
    kept: list[dict[str, np.ndarray]] = []
    number = 0
    while len(kept) < episodes:
        trial, number = Trial(world, (seed, number)), number + 1
        held, _, records = run(trial, by_touch(trial, "raw_taxel"))
        if not held or records[-1][1][1] < 0.5:
            continue
        # A policy learns the end from several frames: the hand goes on feeling while it begins to lift.
        records += [(trial.observe(), records[-1][1]) for _ in range(TAIL)]
        kept.append(
            {key: np.stack([observation[key] for observation, _ in records]) for key in (STATE, CAMERA)}
            | {ACTION: np.stack([action for _, action in records]).astype(np.float32)}
        )
    return kept


def write(root: Path, episodes: list[dict[str, np.ndarray]], touch: bool, taxels: int) -> None:
    """Write demonstrations as a LeRobot dataset, with the readings of touch or without."""
    names = ["arm.mm", "grip.N", *(f"{f}.taxel_{k:02d}.counts" for f in FINGERS for k in range(taxels))]
    names = names if touch else names[:2]
    described = {STATE: names, CAMERA: ["orange.mm", "orange.height.mm"], ACTION: ["arm.mm_per_s", "lift"]}
    features = {key: {"dtype": "float32", "shape": [len(n)], "names": n} for key, n in described.items()}
    columns = [({**e, STATE: np.ascontiguousarray(e[STATE][:, : len(names)])}, "lift the orange") for e in episodes]
    write_whole(root, features, columns, RATE, "two fingertips")
