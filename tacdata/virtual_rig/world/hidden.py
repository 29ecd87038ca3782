"""A world with a hidden effect that no file of the rig names, for trying `tacdata discrepancy`."""

from __future__ import annotations

from collections import deque
from pathlib import Path

import numpy as np

from tacdata.errors import UsageError
from tacdata.sensor import Sensor
from tacdata.virtual_rig.world.world import IndenterProfile, Truth, World

KINDS = {
    "play": "mm that the depth drive stands still after turning",
    "late": "s that readings come late",
    "give": "mm that the frame gives way where the skin pushes back with 1 N",
}
"""Effects that can be hidden, and the meaning of their size."""
TIP_PATH = "true_tip.csv"
"""True path of the indenter, in the rig's folder: for `tacdata revise --truth`, never read by the pipeline."""


def hidden_from(words: list[str]) -> dict[str, float]:
    """Return kind -> size from words such as ``play=0.06``.

    Raises:
        UsageError: If one is not known or has no positive size.
    """
    sizes = {}
    for word in words:
        kind, _, size = word.partition("=")
        try:
            value = float(size)
        except ValueError:
            value = 0.0
        if kind not in KINDS or not 0 < value < 10:
            raise UsageError(
                f"--hide {word}",
                "; ".join(f"{name}=SIZE, {meaning}" for name, meaning in KINDS.items()),
                "for example --hide play=0.06",
            )
        sizes[kind] = value
    return sizes


class HiddenWorld(World):
    """The world with play, compliance or a late board; it writes the true path of the tip."""

    def __init__(self, truth: Truth, sensor: Sensor, hidden: dict[str, float], directory: Path) -> None:
        """Create it; ``hidden`` comes from `hidden_from`, ``directory`` receives `TIP_PATH`."""
        super().__init__(truth, sensor)
        self._hidden, self._path = hidden, directory / TIP_PATH
        self._carriage: float | None = None
        self._given = 0.0
        self._frames: deque[tuple[int, np.ndarray]] = deque()
        directory.mkdir(parents=True, exist_ok=True)
        self._path.write_text("time_ns,x,y,depth\n")

    def readings(self, tip: np.ndarray, indenter: IndenterProfile | None, yaw: float, time_ns: int) -> np.ndarray:
        """Return a frame for the true tip position, now or, if late, earlier."""
        true = np.array([tip[0], tip[1], self._dragged(float(tip[2]))])
        true = self._pushed_back(true, indenter, yaw)
        x, y, depth = self.truth.registration.to_sensor(true[None])[0]
        if indenter is not None and depth > -0.5:
            with self._path.open("a") as stream:
                stream.write(f"{time_ns},{x:.5f},{y:.5f},{depth:.5f}\n")
        return self._late(super().readings(true, indenter, yaw, time_ns), time_ns)

    def _dragged(self, z: float) -> float:
        """Return the carriage's height [mm, machine] with play: it is dragged between two stops.

        The skin was touched off on a way down, so the way down is right and the way up too deep.
        """
        play = self._hidden.get("play", 0.0)
        self._carriage = z if self._carriage is None else min(max(self._carriage, z - play), z)
        return self._carriage

    def _pushed_back(self, tip: np.ndarray, indenter: IndenterProfile | None, yaw: float) -> np.ndarray:
        """Return the tip position at which the frame's compliance balances the skin's force, by bisection."""
        give = self._hidden.get("give", 0.0)
        if give == 0.0:
            return tip
        lift = np.array([0.0, 0.0, 1.0])
        low, high = 0.0, give * float(self.taxel_force(tip, indenter, yaw).sum())
        # The force falls as the tip is lifted, so one balance lies between no lift and that of the full force.
        for _ in range(24):
            middle = 0.5 * (low + high)
            pushed = give * float(self.taxel_force(tip + middle * lift, indenter, yaw).sum())
            low, high = (middle, high) if pushed > middle else (low, middle)
        return tip + 0.5 * (low + high) * lift

    def _late(self, frame: np.ndarray, time_ns: int) -> np.ndarray:
        """Return the frame of an earlier time, interpolated between two."""
        delay = round(self._hidden.get("late", 0.0) * 1e9)
        if delay == 0:
            return frame
        self._frames.append((time_ns, frame))
        # One frame before the delayed time stays, to interpolate from.
        while len(self._frames) > 2 and self._frames[1][0] <= time_ns - delay:
            self._frames.popleft()
        (first, old), (second, new) = self._frames[0], self._frames[min(1, len(self._frames) - 1)]
        share = float(np.clip((time_ns - delay - first) / max(second - first, 1), 0.0, 1.0))
        return np.round(old + share * (new - old))
