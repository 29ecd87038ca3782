"""Data of the contact kernels: surface, members of a batch and history as Warp structs."""

from tacdata.skin.contact.history import ContactHistory
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose
from tacdata.skin.member.warp_arrays import filled
from tacdata.warp_runtime import wp

Parameters = wp.types.vector(length=8, dtype=wp.float64)
"""Numbers of an indenter's distance function."""


Six = wp.types.vector(length=6, dtype=wp.float64)
Nodal = wp.types.matrix((6, 3), wp.float64)
"""Of a face's nodes: numbers, vectors."""


@wp.struct
class SurfaceData:
    """Constants of a surface: faces of the mesh, their quadrature rule, hats, and the stiffness of friction."""

    nodes: wp.array2d(dtype=wp.float64)
    faces: wp.array2d(dtype=wp.int32)
    slots: wp.array2d(dtype=wp.int32)
    shapes: wp.array2d(dtype=wp.float64)
    hats: wp.array2d(dtype=wp.float64)
    weights: wp.array2d(dtype=wp.float64)
    area: wp.array(dtype=wp.float64)
    stick: wp.float64
    rough: int


@wp.struct
class MemberData:
    """Conditions and pose of the batch members (or their changes)."""

    thickness: wp.array(dtype=wp.float64)
    modulus: wp.array(dtype=wp.float64)
    friction: wp.array(dtype=wp.float64)
    indenter: wp.array2d(dtype=wp.float64)
    place: wp.array2d(dtype=wp.float64)
    turn: wp.array3d(dtype=wp.float64)


@wp.struct
class HistoryData:
    """`ContactHistory` (or its change)."""

    anchor: wp.array3d(dtype=wp.float64)
    held: wp.array3d(dtype=wp.float64)
    gap: wp.array2d(dtype=wp.float64)
    place: wp.array2d(dtype=wp.float64)


def member_data(conditions: Conditions, pose: Pose) -> MemberData:
    """Return conditions and pose as a kernel takes them; all tensors contiguous."""
    return filled(
        MemberData,
        thickness=conditions.thickness,
        modulus=conditions.modulus,
        friction=conditions.friction,
        indenter=conditions.indenter,
        place=pose.place,
        turn=pose.turn,
    )


def history_data(history: ContactHistory) -> HistoryData:
    """Return a history as a kernel takes it; all tensors contiguous."""
    return filled(HistoryData, anchor=history.anchor, held=history.held, gap=history.gap, place=history.place)
