# Warp kernels are Python in form only; their operators have no types that pyright knows.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportReturnType=false, reportAssignmentType=false, reportInvalidTypeForm=false
"""What every element kernel does: read an element's nodes, form the displacement gradient, add forces to the nodes."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from tacdata.skin.constitutive import kinematics


@cache
def element_functions(real: type) -> SimpleNamespace:
    """Return Warp functions in one precision.

    ``gather(u, tets, e, b)``: an element's nodal values; ``slope(slopes, e, q, a, s)``: gradient of a shape function;
    ``gradient(values, slopes, e, q, s)``: of nodal values; ``add(values, tets, e, b, total)``: onto the nodes;
    ``constants(m, b)``: a member's law; ``stretch(slab, thickness, e, b)``: of the element by the member's thickness.
    ``Nodal``: type of an element's nodal values.
    """
    Parameters = kinematics.parameters(real)
    vec3, mat33 = wp.types.vector(3, real), kinematics.matrix(real)
    Nodal = wp.types.matrix((10, 3), real)

    @wp.func
    def gather(u: wp.array3d(dtype=real), tets: wp.array2d(dtype=wp.int32), e: int, b: int):
        values = Nodal()
        for a in range(10):
            n = tets[e, a]
            for i in range(3):
                values[a, i] = u[n, i, b]
        return values

    @wp.func
    def slope(slopes: wp.array4d(dtype=real), e: int, q: int, a: int, s: real):
        return vec3(slopes[e, q, a, 0], slopes[e, q, a, 1], slopes[e, q, a, 2] / s)

    @wp.func
    def gradient(values: Nodal, slopes: wp.array4d(dtype=real), e: int, q: int, s: real):
        H = mat33()
        for a in range(10):
            g = slope(slopes, e, q, a, s)
            H += wp.outer(vec3(values[a, 0], values[a, 1], values[a, 2]), g)
        return H

    @wp.func
    def add(values: Nodal, tets: wp.array2d(dtype=wp.int32), e: int, b: int, total: wp.array3d(dtype=real)):
        for a in range(10):
            n = tets[e, a]
            for i in range(3):
                wp.atomic_add(total, n, i, b, values[a, i])

    @wp.func
    def constants(m: wp.array2d(dtype=real), b: int):
        values = Parameters()
        for k in range(8):
            values[k] = m[k, b]
        return values

    @wp.func
    def stretch(slab: wp.array(dtype=wp.int32), thickness: wp.array(dtype=real), e: int, b: int):
        s = real(1.0)
        if slab[e] == 1:
            s = thickness[b]
        return s

    return SimpleNamespace(
        gather=gather, slope=slope, gradient=gradient, add=add, constants=constants, stretch=stretch, Nodal=Nodal
    )
