"""Kills workers and the service at random while they label, and holds the outcome against an undisturbed run.

Run ``python benchmarks/label_farm_chaos.py [--jobs 2000] [--kills 200] [--seed 1]``; it takes minutes. Every label and
every solved path must be there exactly once, every value bit for bit as without kills; else it ends in an error.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parent.parent / "tests" / "label_farm"))

import chaos

SESSIONS = 4


def main() -> None:
    """Record, torment, compare; print figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=2000)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=0.1, help="time that a job takes [s]")
    asked = parser.parse_args()
    presses = asked.jobs // SESSIONS
    with tempfile.TemporaryDirectory() as name:
        chaotic, peaceful = Path(name) / "chaotic", Path(name) / "peaceful"
        chaotic.mkdir()
        peaceful.mkdir()
        names = chaos.record(chaotic, SESSIONS, presses)
        killed, left, seconds = chaos.torment(
            chaotic, names, SESSIONS * presses, asked.kills, asked.seed, asked.seconds
        )
        began = time.monotonic()
        chaos.undisturbed(peaceful, chaotic, names)
        in_peace = time.monotonic() - began
        again = chaos.compare(chaotic, peaceful, names, presses)
    figures = {
        "jobs": SESSIONS * presses,
        "killed": dict(killed),
        "open_at_last_kill": left,
        "seconds": round(seconds, 1),
        "seconds_in_peace_without_work": round(in_peace, 1),
        "solved_again": again,
        "lost": 0,
        "doubled": 0,
        "different": 0,
    }
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
