"""Notices tags and cubes that were mixed up: a finger with another's cube, one hand with the other's.

A tag's number alone never shows that; the poses do. Two cubes cannot be in one place. A cube's tags are where the cube
is. A finger does not change places with another between two images. Index and middle finger of a right hand stand in
the other order than those of a left one.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from tacdata.tags.fingers import Finger

if TYPE_CHECKING:
    from tacdata.tags.cube.pose import CubePose

NEARER = 0.5
"""Largest share [1] of the distance between two cubes that may remain after a jump for it to count as an exchange."""
SIDEWAYS = 0.5
"""Smallest sine of the angle between the line from index to middle finger and the fingers [1] for telling hands apart.
"""


def mixups(fingers: dict[str, Finger], cubes: dict[str, CubePose]) -> tuple[str, ...]:
    """Describe the suspected swaps in one image.

    Args:
        fingers: The fingers.
        cubes: Poses of the cubes that are seen, by finger.
    """
    remarks = [
        f"tag {', '.join(map(str, pose.strays))} of {name} is read away from {name}'s cube: a tag on a wrong "
        "face or cube, or a second cube with the same numbers"
        for name, pose in cubes.items()
        if pose.strays
    ]
    for (one, a), (other, b) in combinations(cubes.items(), 2):
        room = (fingers[one].cube.side + fingers[other].cube.side) / 2000
        if np.linalg.norm(a.position - b.position) < 0.9 * room:
            remarks.append(f"the cubes of {one} and {other} are in one place: tags of both are on one cube")
    for hand in ("left", "right"):
        found = handedness({n: f for n, f in fingers.items() if f.hand == hand}, cubes)
        if found and found != hand:
            remarks.append(
                f"index and middle finger of the {hand} hand stand as those of a {found} one: "
                "the hands' cubes are swapped, or these two fingers'"
            )
    return tuple(remarks)


def handedness(fingers: dict[str, Finger], cubes: dict[str, CubePose]) -> str:
    """Return "left" or "right" by the order of index and middle finger, "" if one is not seen or it is unclear.

    Looking along the fingers with the pads down, a right hand has its middle finger right of its index.
    """
    seen = {f.kind: cubes[name] for name, f in fingers.items() if name in cubes and not cubes[name].ambiguous}
    tips = {f.kind: f.tip for name, f in fingers.items() if f.kind in seen}
    if not {"index", "middle"} <= set(seen):
        return ""
    index, middle = (seen[kind].matrix @ tips[kind] for kind in ("index", "middle"))
    across = middle[:3, 3] - index[:3, 3]
    forward, out_of_pad = index[:3, 0] + middle[:3, 0], index[:3, 2] + middle[:3, 2]
    # Seen with the pads down, right is forward x up, and up is against the pads.
    right = np.cross(forward, -out_of_pad)
    length = np.linalg.norm(right) * np.linalg.norm(across)
    side = float(right @ across) / length if length > 0 else 0.0
    return "" if abs(side) < SIDEWAYS else "right" if side > 0 else "left"


def exchanged(before: dict[str, CubePose], now: dict[str, CubePose]) -> tuple[str, ...]:
    """Describe the fingers that seem to have changed places between two images.

    Args:
        before: Poses of the cubes in an image, by finger.
        now: The same in a later image.
    """
    remarks = []
    for one, other in combinations(sorted(set(before) & set(now)), 2):
        distance = np.linalg.norm(before[one].position - before[other].position)
        jumps = (
            np.linalg.norm(now[one].position - before[other].position),
            np.linalg.norm(now[other].position - before[one].position),
        )
        if max(jumps) < NEARER * distance:
            remarks.append(f"{one} and {other} have changed places between two images: their tags' numbers are swapped")
    return tuple(remarks)
