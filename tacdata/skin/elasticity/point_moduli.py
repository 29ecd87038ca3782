"""Kernels of a prepared tangent (`tacdata.skin.elasticity.prepared_tangent`).

Lanes are members in one vector. A CPU works on them at once.
"""

from functools import cache
from types import SimpleNamespace

from tacdata.skin.constitutive import kinematics
from tacdata.skin.elasticity.averaged_kernels import BEARABLE
from tacdata.skin.elasticity.element_functions import constant_data, element_data, element_functions
from tacdata.skin.materials import load_law
from tacdata.warp_runtime import wp

LANES = 8
"""Members that are worked on at a time."""

NUMBERS = 54
"""Kept of a point: 45 moduli and the cofactor of F.

Moduli are symmetric 3 x 3 blocks of 3 x 3. For each row of blocks there stand those before the diagonal, column by
column, then xx, yy, zz, xy, yz, xz of the diagonal's."""


@cache
def moduli_kernel(law_name: str, real: type) -> wp.Kernel:
    """Compile the kernel of moduli."""
    law = load_law(law_name)
    tangent_of, bulk_of = law.tangent_function(real, "H"), law.bulk_function(real)
    volume = kinematics.volume(real)
    cofactor_change, volume_change = volume.cofactor_change, volume.change
    cross, shifted, mat33 = volume.cross, volume.shifted, kinematics.matrix(real)
    ElementData, ConstantData = element_data(real), constant_data(real)
    of_element = element_functions(real)
    gather, gradient = of_element.gather, of_element.gradient
    constants, stretch = of_element.constants, of_element.stretch
    bearable = wp.constant(real(BEARABLE))

    @wp.kernel(module="unique", enable_backward=False)
    def moduli(
        u: wp.array3d(dtype=real),
        mesh: ElementData,
        material: ConstantData,
        average: wp.array2d(dtype=real),
        lane: wp.array(dtype=wp.int32),
        moved: real,
        values: wp.array4d(dtype=real),
        bulk: wp.array(dtype=real),
    ):
        """Moduli and cofactors of one element of a member, times the volume of each point.

        1. Displacement gradient, cofactor. Where it is as before but for ``moved``, all stays.
        2. Change of stress along each entry of F; that by z over the stretch of the mesh, once and for all.
        """
        e, b = wp.tid()
        nodal, c, s = gather(u, mesh, e, b), constants(material, b), stretch(mesh, material, e, b)
        kappa, at = bulk_of(c), lane[b]
        limit = bearable * material.modulus[b] / kappa
        bulk[at] = kappa
        for q in range(4):
            H = gradient(nodal, mesh, e, q, s)
            K = cofactor_change(H)
            F, cof = shifted(H, real(1.0)), shifted(K, real(1.0))
            w = mesh.weights[e, q] * s
            change = real(0.0)
            for i in range(9):
                scale = w
                if i % 3 == 2:
                    scale = w / s
                change = wp.max(change, wp.abs(values[e, q, 45 + i, at] - cof[i // 3, i % 3] * scale) / scale)
            # Values of unprepared lanes are infinite; "not <=" also catches NaN.
            if not change <= moved:
                mean = real(0.0)
                for a in range(4):
                    mean += mesh.shapes[q, a] * average[mesh.corners[e, a], b]
                excess = wp.clamp(mean, -limit, limit) - volume_change(H, K)
                for i in range(9):
                    D = mat33()
                    D[i // 3, i % 3] = real(1.0)
                    scale = w
                    if i % 3 == 2:
                        scale = w / s
                    # The point's own volumetric stiffness is subtracted here; `product` adds its average.
                    dP = scale * (tangent_of(H, D, c) + kappa * (excess * cross(F, D) - cof[i // 3, i % 3] * cof))
                    values[e, q, 45 + i, at] = cof[i // 3, i % 3] * scale
                    for row in range(i // 3, 3):
                        # Each row r above has 9 r numbers before its diagonal block and 6 in it.
                        first = 9 * row * (row - 1) // 2 + 6 * row
                        x, y, z = dP[row, 0], dP[row, 1], dP[row, 2] / s
                        if row > i // 3:
                            values[e, q, first + 3 * i, at] = x
                            values[e, q, first + 3 * i + 1, at] = y
                            values[e, q, first + 3 * i + 2, at] = z
                        else:
                            k = first + 9 * row
                            if i % 3 == 0:
                                values[e, q, k, at] = x
                                values[e, q, k + 3, at] = y
                                values[e, q, k + 5, at] = z
                            if i % 3 == 1:
                                values[e, q, k + 1, at] = y
                                values[e, q, k + 4, at] = z
                            if i % 3 == 2:
                                values[e, q, k + 2, at] = z

    return moduli


@cache
def product_kernels(real: type) -> SimpleNamespace:
    """Compile the kernels of products. ``block`` gives the lanes of a vector of ``p``."""
    ElementData, Lanes, Nine = element_data(real), wp.types.vector(LANES, real), wp.types.matrix((9, LANES), real)

    @wp.func
    def gradient(p: wp.array3d(dtype=Lanes), mesh: ElementData, e: int, q: int, b: int):
        D = Nine()
        for a in range(10):
            n = mesh.tets[e, a]
            for i in range(3):
                direction = p[n, i, b]
                for j in range(3):
                    D[3 * i + j] = D[3 * i + j] + mesh.slopes[e, q, a, j] * direction
        return D

    @wp.kernel(module="unique", enable_backward=False)
    def swelling(
        p: wp.array3d(dtype=Lanes),
        mesh: ElementData,
        moduli: wp.array4d(dtype=Lanes),
        block: wp.array(dtype=wp.int32),
        sums: wp.array2d(dtype=Lanes),
    ):
        """Change of one element's volume along ``p``, weighted by its corners' shape functions."""
        e, b = wp.tid()
        o = block[b]
        for q in range(mesh.weights.shape[1]):
            D, change = gradient(p, mesh, e, q, b), Lanes()
            for i in range(3):
                for j in range(3):
                    change += wp.cw_mul(moduli[e, q, 45 + 3 * i + j, o], D[3 * i + j])
            for a in range(4):
                wp.atomic_add(sums, mesh.corners[e, a], b, mesh.shapes[q, a] * change)

    @wp.kernel(module="unique", enable_backward=False)
    def correct(
        first: wp.array(dtype=wp.int32),
        neighbour: wp.array(dtype=wp.int32),
        mass: wp.array2d(dtype=real),
        lumped: wp.array2d(dtype=real),
        thickness: wp.array(dtype=Lanes),
        sums: wp.array2d(dtype=Lanes),
        estimate: wp.array2d(dtype=Lanes),
        corrected: wp.array2d(dtype=Lanes),
    ):
        """A step of Richardson's iteration towards the average, as in `averaged_volume`."""
        a, b = wp.tid()
        s, still, slab = thickness[b], Lanes(), Lanes()
        for k in range(first[a], first[a + 1]):
            value = estimate[neighbour[k], b]
            still += mass[0, k] * value
            slab += mass[1, k] * value
        remainder = sums[a, b] - still - wp.cw_mul(s, slab)
        weight = lumped[1, a] * s
        for i in range(LANES):
            weight[i] = weight[i] + lumped[0, a]
        corrected[a, b] = estimate[a, b] + wp.cw_div(remainder, weight)

    @wp.kernel(module="unique", enable_backward=False)
    def product(
        p: wp.array3d(dtype=Lanes),
        mesh: ElementData,
        moduli: wp.array4d(dtype=Lanes),
        block: wp.array(dtype=wp.int32),
        pressure: wp.array2d(dtype=Lanes),
        total: wp.array3d(dtype=Lanes),
    ):
        """Moduli of one element times nodal displacements ``p``, and the averaged change of pressure at the corners."""
        e, b = wp.tid()
        o, axes = block[b], mesh.slopes.shape[3]
        for q in range(mesh.weights.shape[1]):
            D, P, mean = gradient(p, mesh, e, q, b), Nine(), Lanes()
            for a in range(4):
                mean += mesh.shapes[q, a] * pressure[mesh.corners[e, a], b]
            for i in range(3):
                for j in range(3):
                    P[3 * i + j] = wp.cw_mul(moduli[e, q, 45 + 3 * i + j, o], mean)
            k = wp.int32(0)
            for i in range(axes):
                x = D[3 * i]
                y = D[3 * i + 1]
                z = D[3 * i + 2]
                X = P[3 * i]
                Y = P[3 * i + 1]
                Z = P[3 * i + 2]
                for j in range(i):
                    for m in range(3):
                        entry = D[3 * j + m]
                        cx = moduli[e, q, k, o]
                        cy = moduli[e, q, k + 1, o]
                        cz = moduli[e, q, k + 2, o]
                        X += wp.cw_mul(cx, entry)
                        Y += wp.cw_mul(cy, entry)
                        Z += wp.cw_mul(cz, entry)
                        P[3 * j + m] = P[3 * j + m] + wp.cw_mul(cx, x) + wp.cw_mul(cy, y) + wp.cw_mul(cz, z)
                        k += 3
                xx = moduli[e, q, k, o]
                yy = moduli[e, q, k + 1, o]
                zz = moduli[e, q, k + 2, o]
                xy = moduli[e, q, k + 3, o]
                yz = moduli[e, q, k + 4, o]
                xz = moduli[e, q, k + 5, o]
                P[3 * i] = X + wp.cw_mul(xx, x) + wp.cw_mul(xy, y) + wp.cw_mul(xz, z)
                P[3 * i + 1] = Y + wp.cw_mul(xy, x) + wp.cw_mul(yy, y) + wp.cw_mul(yz, z)
                P[3 * i + 2] = Z + wp.cw_mul(xz, x) + wp.cw_mul(yz, y) + wp.cw_mul(zz, z)
                k += 6
            for a in range(10):
                n = mesh.tets[e, a]
                for i in range(3):
                    f = Lanes()
                    for j in range(3):
                        f += mesh.slopes[e, q, a, j] * P[3 * i + j]
                    wp.atomic_add(total, n, i, b, f)

    return SimpleNamespace(swelling=swelling, correct=correct, product=product)
