"""Whether skin has come out on the far side of a thin shape.

A point that a long step carries past the middle of a thin shape is pushed out above it. There is an equilibrium there
too, or no contact at all, with a wrong surface. So from every point of the face a ray is cast downward. Where it meets
the shape, the point is above it.

A leaning flank is below points, too, but grazes their rays: under a lean of 30 degrees, the most that is allowed,
a ray is never deeper in the shape than half of its own length.
"""

from __future__ import annotations

from functools import cache

from tacdata.skin.contact.kernel_data import MemberData, SurfaceData
from tacdata.skin.contact.kernels import deformed_point, of_member, parameters_of, rotation_of
from tacdata.warp_runtime import wp

_SAMPLES = wp.constant(16)
"""Points of a ray where the distance is asked for [count]."""

_STEEPEST = wp.constant(wp.float64(0.55))
"""Depth in the shape over the length of the ray that a leaning flank cannot reach [1]."""


@cache
def passage_kernel(distance: wp.Function) -> wp.Kernel:
    """Compile the kernel for one shape."""

    @wp.kernel(module="unique", enable_backward=False)
    def passages(
        u: wp.array3d(dtype=wp.float64),
        surface: SurfaceData,
        members: MemberData,
        chosen: wp.array(dtype=wp.int32),
        above: wp.array(dtype=wp.int32),
    ):
        """Mark a chosen member if a point of a face is above its shape."""
        f, c = wp.tid()
        b = chosen[c]
        q = parameters_of(members.indenter, b)
        R = rotation_of(members.turn, b)
        tip = of_member(members.place, b)
        for k in range(surface.weights.shape[1]):
            point = deformed_point(u, surface, f, k, b, members.thickness[b]) - tip
            height = point[2]
            if height > wp.float64(0.0) and above[b] == 0:
                gap = distance(wp.transpose(R) * point, q)
                # A ray gets nearer to the shape by no more than its own length.
                if gap < (wp.float64(1.0) - _STEEPEST) * height:
                    # Between nodes the face dips into the shape by some micrometres: that is where the ray begins.
                    begin = wp.min(gap, wp.float64(0.0))
                    for i in range(_SAMPLES):
                        length = height * (wp.float64(i) + wp.float64(1.0)) / wp.float64(_SAMPLES)
                        on_ray = wp.transpose(R) * wp.vec3d(point[0], point[1], height - length)
                        if distance(on_ray, q) < begin - _STEEPEST * length:
                            above[b] = 1

    return passages
