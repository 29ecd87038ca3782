"""Parts of every element kernel: the mesh and the members as structs, gather, gradient, scatter.

Indices: e an element, q a point of its quadrature rule, a a node of it, b a batch member.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

from tacdata.skin.constitutive import kinematics
from tacdata.warp_runtime import wp


@cache
def element_data(real: type) -> Any:
    """Return the struct of constant data: the mesh in one precision."""

    @wp.struct
    class ElementData:
        tets: wp.array2d(dtype=wp.int32)  # nodes, (e, 10)
        corners: wp.array2d(dtype=wp.int32)  # number of each corner among all corners, (e, 4)
        shapes: wp.array2d(dtype=real)  # linear shape functions of the corners at the points, (q, 4)
        slopes: wp.array4d(dtype=real)  # gradients of the shape functions [1/mm], (e, q, 10, 3)
        at_points: wp.array2d(dtype=wp.types.matrix((10, 3), real))  # the same, read as a whole in fewer steps, (e, q)
        weights: wp.array2d(dtype=real)  # volume of the points [mm^3], (e, q)
        slab: wp.array(dtype=wp.int32)  # 1 where the element stretches with the slab's thickness, (e,)

    return ElementData


@cache
def constant_data(real: type) -> Any:
    """Return the struct of the members' constants in one precision."""

    @wp.struct
    class ConstantData:
        law: wp.array2d(dtype=real)  # numbers of the law, (8, b)
        modulus: wp.array(dtype=real)  # Young's modulus [MPa], (b,)
        thickness: wp.array(dtype=real)  # of the slab over that of the mesh [1], (b,)

    return ConstantData


@cache
def element_functions(real: type) -> SimpleNamespace:
    """Return Warp functions in one precision.

    - ``gather(u, mesh, e, b)``: an element's nodal values, of the type ``Nodal``
    - ``gradient(values, mesh, e, q, s)``: gradient of nodal values
    - ``forces(P, mesh, e, q, s)``: nodal values that do with any others the work of P with their gradient
    - ``add(values, mesh, e, b, total)``: scatter nodal values onto the nodes
    - ``constants(own, b)``: the numbers of a member's law
    - ``stretch(mesh, own, e, b)``: stretch s of the element by the member's thickness
    """
    ElementData, ConstantData = element_data(real), constant_data(real)
    Parameters = kinematics.parameters(real)
    mat33 = kinematics.matrix(real)
    Nodal = wp.types.matrix((10, 3), real)

    @wp.func
    def gather(u: wp.array3d(dtype=real), mesh: ElementData, e: int, b: int):
        values = Nodal()
        for a in range(10):
            n = mesh.tets[e, a]
            for i in range(3):
                values[a, i] = u[n, i, b]
        return values

    @wp.func
    def thinned(values: mat33, s: real):
        # The undeformed slab is s times as thick as the mesh, so derivatives by z are 1 / s of the mesh's.
        thinner = real(1.0) / s
        for i in range(3):
            values[i, 2] = values[i, 2] * thinner
        return values

    @wp.func
    def gradient(values: Nodal, mesh: ElementData, e: int, q: int, s: real):
        # The displacement gradient, not F: at small strain F - I would lose digits (0007).
        return thinned(wp.transpose(values) * mesh.at_points[e, q], s)

    @wp.func
    def forces(P: mat33, mesh: ElementData, e: int, q: int, s: real):
        return mesh.at_points[e, q] * wp.transpose(thinned(P, s))

    @wp.func
    def add(values: Nodal, mesh: ElementData, e: int, b: int, total: wp.array3d(dtype=real)):
        for a in range(10):
            n = mesh.tets[e, a]
            for i in range(3):
                wp.atomic_add(total, n, i, b, values[a, i])

    @wp.func
    def constants(material: ConstantData, b: int):
        values = Parameters()
        for k in range(8):
            values[k] = material.law[k, b]
        return values

    @wp.func
    def stretch(mesh: ElementData, material: ConstantData, e: int, b: int):
        s = real(1.0)
        if mesh.slab[e] == 1:
            s = material.thickness[b]
        return s

    return SimpleNamespace(
        gather=gather, gradient=gradient, forces=forces, add=add, constants=constants, stretch=stretch, Nodal=Nodal
    )
