"""The whole loop on a virtual rig: an effect is hidden, presses are recorded and judged until it has a name.

    python examples/closed_loop/closed_loop.py --out loop

The rig's depth drive has play that no file states. Twelve presses at one speed cannot separate it from a lag or from
friction; `tacdata revise` writes the presses that can, the rig records them, and the second verdict names it. Then the
model gets the effect, the paths of the labels move, and the gap is shown before and after (`loop/*/card.html`).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import yaml

from tacdata.virtual_rig.rig import VirtualRig
from tacdata.virtual_rig.world.world import World

PLAY = 0.06
"""Play of the depth drive [mm]: after turning, the carriage stays where it is for so long."""
ROUNDS = 3
"""Most rounds of judging and recording."""


class WorldWithPlay(World):
    """The rig's world with a loose depth drive and a skin that forgets at once."""

    carriage: float | None = None
    """Where the carriage truly is [mm, machine]."""

    def readings(self, tip, indenter, yaw, time_ns):
        """Return a frame of a carriage that is dragged along between two stops."""
        z = float(tip[2])
        low, high = z, z + PLAY
        self.carriage = z if self.carriage is None else min(max(self.carriage, low), high)
        contact = np.array([tip[0], tip[1], self.carriage])
        return super().readings(contact, indenter, yaw, time_ns)

    def _relaxed(self, elastic, time_ns):
        return elastic


def first_plan(path: Path) -> None:
    """Write presses at one speed, as a lab would that has not thought of play."""
    presses = [
        {"indenter": "ball", "x": x, "y": y, "depth": depth, "repeat": repeat}
        for repeat in range(3)
        for x, y in ((0.95, 1.25), (-0.95, -1.25))
        for depth in (0.6, 0.9)
    ]
    motion = {
        "clearance": 3.0,
        "travel_speed": 15.0,
        "approach_speed": 5.0,
        "press_speed": 0.8,
        "hold": 0.6,
        "rest": 0.5,
    }
    document = {
        "version": "1.1",
        "name": "one speed",
        "indenters": {"ball": {"shape": "sphere", "radius": 4.0}},
        "motion": motion,
        "presses": presses,
    }
    path.write_text(yaml.safe_dump(document, sort_keys=False))


def tacdata(*arguments: object) -> None:
    """Run a verb, as a person would."""
    print("$ tacdata", *arguments, flush=True)
    subprocess.run([sys.executable, "-m", "tacdata", *map(str, arguments)], check=True)


def loop(folder: Path, speed: float, rounds: int = ROUNDS) -> str:
    """Record, judge, plan and record again until the effect has a name; return the last verdict's status."""
    folder.mkdir(parents=True)
    rig = VirtualRig(folder / "rig", speed=speed, seed=5, camera=False)
    rig.world = WorldWithPlay(rig.truth, rig.sensor)
    first_plan(folder / "plan-1.yaml")
    plan, sessions, status = folder / "plan-1.yaml", [], ""
    rig.start()
    try:
        for turn in range(1, rounds + 1):
            sessions.append(folder / f"session-{turn}")
            tacdata("record", "--rig", rig.path, "--plan", plan, "--out", sessions[-1], "--yes")
            verdict, revision = folder / f"verdict-{turn}", folder / f"revision-{turn}"
            tacdata("discrepancy", *sessions, "--out", verdict)
            tacdata("revise", verdict, *sessions, "--out", revision)
            status = json.loads((verdict / "verdict.json").read_text())["status"]
            plan = revision / "next.yaml"
            if status == "named" or not plan.is_file():
                break
    finally:
        rig.stop()
    return status


def main() -> None:
    """Run the loop."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("loop"))
    parser.add_argument("--speed", type=float, default=4.0, help="seconds of the rig per real second")
    options = parser.parse_args()
    if options.out.exists():
        parser.error(f"{options.out} exists: choose another --out")
    status = loop(options.out, options.speed)
    print(f"hidden: play of {PLAY} mm; the last verdict: {status} ({options.out}/verdict-*/verdict.txt)")


if __name__ == "__main__":
    main()
