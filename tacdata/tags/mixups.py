"""Notices tags and cubes that were mixed up: a finger with another's cube, one hand with the other's.

A tag's number alone never shows that; the poses do. Two cubes cannot be in one place. A cube's tags are where the cube
is. Two fingers do not change places between two images. Index and middle finger of a right hand are in
the reverse order of those of a left one.
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
    for (first_name, a), (second_name, b) in combinations(cubes.items(), 2):
        room = (fingers[first_name].cube.side + fingers[second_name].cube.side) / 2000
        # Cubes that touch are a side's length apart; a tenth of it is for errors of their poses.
        if np.linalg.norm(a.position - b.position) < 0.9 * room:
            remarks.append(
                f"the cubes of {first_name} and {second_name} are in one place: tags of both are on one cube"
            )
    for hand in ("left", "right"):
        order = handedness({n: f for n, f in fingers.items() if f.hand == hand}, cubes)
        if order and order != hand:
            remarks.append(
                f"index and middle finger of the {hand} hand stand as those of a {order} one: "
                "the hands' cubes are swapped, or these two fingers'"
            )
    return tuple(remarks)


def handedness(fingers: dict[str, Finger], cubes: dict[str, CubePose]) -> str:
    """Return "left" or "right" by the order of index and middle finger, "" if one is not seen or it is unclear.

    Looking along the fingers with the pads down, a right hand has its middle finger right of its index.
    """
    poses = {f.kind: cubes[name] for name, f in fingers.items() if name in cubes and not cubes[name].ambiguous}
    tips = {f.kind: f.tip for name, f in fingers.items() if f.kind in poses}
    if not {"index", "middle"} <= set(poses):
        return ""
    index, middle = (poses[kind].matrix @ tips[kind] for kind in ("index", "middle"))
    separation = middle[:3, 3] - index[:3, 3]
    forward, out_of_pad = index[:3, 0] + middle[:3, 0], index[:3, 2] + middle[:3, 2]
    # Seen with the pads down, right is forward x up, and up is against the pads.
    right = np.cross(forward, -out_of_pad)
    length = np.linalg.norm(right) * np.linalg.norm(separation)
    side = float(right @ separation) / length if length > 0 else 0.0
    return "" if abs(side) < SIDEWAYS else "right" if side > 0 else "left"


def exchanged(earlier: dict[str, CubePose], later: dict[str, CubePose]) -> tuple[str, ...]:
    """Describe the fingers that seem to have changed places between two images.

    Args:
        earlier: Poses of the cubes in an image, by finger.
        later: The same in a later image.
    """
    remarks = []
    for name, partner in combinations(sorted(set(earlier) & set(later)), 2):
        distance = np.linalg.norm(earlier[name].position - earlier[partner].position)
        jumps = (
            np.linalg.norm(later[name].position - earlier[partner].position),
            np.linalg.norm(later[partner].position - earlier[name].position),
        )
        # Each must be near the other's place: one finger alone may have moved there.
        if max(jumps) < NEARER * distance:
            remarks.append(
                f"{name} and {partner} have changed places between two images: their tags' numbers are swapped"
            )
    return tuple(remarks)
