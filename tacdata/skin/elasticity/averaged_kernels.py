# Warp kernels are Python in form only; their operators have no types that pyright knows.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportReturnType=false, reportAssignmentType=false
"""Kernels of a body whose volume changes are averaged at the corners (`tacdata.skin.elasticity.averaged_volume`).

Each element reads its nodes once and adds to them once: on a card it is these accesses that cost, not the arithmetic.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from tacdata.skin.constitutive import kinematics
from tacdata.skin.elasticity.element_functions import element_functions
from tacdata.skin.materials import load_law

_BEARABLE = 1.0
"""Pressure over Young's modulus beyond which the tangent no longer follows it [1]."""


@cache
def averaged_kernels(law_name: str, real: type) -> SimpleNamespace:
    """Compile the kernels for one law in one precision."""
    law = load_law(law_name)
    energy_of, stress_of = law.energy_function(real, "H"), law.stress_function(real, "H")
    tangent_of, bulk_of = law.tangent_function(real, "H"), law.bulk_function(real)
    volume = kinematics.volume(real)
    cofactor_change, volume_change = volume.cofactor_change, volume.change
    cross, shifted = volume.cross, volume.shifted
    of_element = element_functions(real)
    gather, slope, gradient, add = of_element.gather, of_element.slope, of_element.gradient, of_element.add
    constants, stretch, Nodal = of_element.constants, of_element.stretch, of_element.Nodal
    bearable = wp.constant(real(_BEARABLE))
    Four = wp.types.vector(4, real)

    @wp.func
    def at_corners(field: wp.array2d(dtype=real), corners: wp.array2d(dtype=wp.int32), e: int, b: int):
        values = Four()
        for a in range(4):
            values[a] = field[corners[e, a], b]
        return values

    @wp.func
    def at_point(values: Four, shapes: wp.array2d(dtype=real), q: int):
        value = real(0.0)
        for a in range(4):
            value += shapes[q, a] * values[a]
        return value

    @wp.kernel(module="unique", enable_backward=False)
    def swelling(
        u: wp.array3d(dtype=real), tets: wp.array2d(dtype=wp.int32), corners: wp.array2d(dtype=wp.int32),
        shapes: wp.array2d(dtype=real), slopes: wp.array4d(dtype=real), weights: wp.array2d(dtype=real),
        slab: wp.array(dtype=wp.int32), thickness: wp.array(dtype=real), sums: wp.array2d(dtype=real),
    ):
        e, b = wp.tid()
        values, s = gather(u, tets, e, b), stretch(slab, thickness, e, b)
        total = Four()
        for q in range(4):
            H = gradient(values, slopes, e, q, s)
            j = volume_change(H, cofactor_change(H)) * (weights[e, q] * s)
            for a in range(4):
                total[a] = total[a] + shapes[q, a] * j
        for a in range(4):
            wp.atomic_add(sums, corners[e, a], b, total[a])

    @wp.kernel(module="unique", enable_backward=False)
    def swelling_change(
        u: wp.array3d(dtype=real), p: wp.array3d(dtype=real), tets: wp.array2d(dtype=wp.int32),
        corners: wp.array2d(dtype=wp.int32), shapes: wp.array2d(dtype=real), slopes: wp.array4d(dtype=real),
        weights: wp.array2d(dtype=real), slab: wp.array(dtype=wp.int32), thickness: wp.array(dtype=real),
        sums: wp.array2d(dtype=real),
    ):
        e, b = wp.tid()
        values, along = gather(u, tets, e, b), gather(p, tets, e, b)
        s, total = stretch(slab, thickness, e, b), Four()
        for q in range(4):
            cof = shifted(cofactor_change(gradient(values, slopes, e, q, s)), real(1.0))
            j = wp.ddot(cof, gradient(along, slopes, e, q, s)) * (weights[e, q] * s)
            for a in range(4):
                total[a] = total[a] + shapes[q, a] * j
        for a in range(4):
            wp.atomic_add(sums, corners[e, a], b, total[a])

    @wp.kernel(module="unique", enable_backward=False)
    def force(
        u: wp.array3d(dtype=real), tets: wp.array2d(dtype=wp.int32), corners: wp.array2d(dtype=wp.int32),
        shapes: wp.array2d(dtype=real), slopes: wp.array4d(dtype=real), weights: wp.array2d(dtype=real),
        slab: wp.array(dtype=wp.int32), thickness: wp.array(dtype=real), m: wp.array2d(dtype=real),
        average: wp.array2d(dtype=real), smallest: wp.array(dtype=real), total: wp.array3d(dtype=real),
    ):
        e, b = wp.tid()
        values, result, c = gather(u, tets, e, b), Nodal(), constants(m, b)
        s, kappa, averages = stretch(slab, thickness, e, b), bulk_of(c), at_corners(average, corners, e, b)
        least = real(1.0e30)
        for q in range(4):
            H = gradient(values, slopes, e, q, s)
            least = wp.min(least, wp.determinant(wp.identity(n=3, dtype=real) + H))
            K = cofactor_change(H)
            excess = kappa * (at_point(averages, shapes, q) - volume_change(H, K))
            P = (stress_of(H, c) + excess * shifted(K, real(1.0))) * (weights[e, q] * s)
            for a in range(10):
                f = P * slope(slopes, e, q, a, s)
                for i in range(3):
                    result[a, i] = result[a, i] + f[i]
        wp.atomic_min(smallest, b, least)
        add(result, tets, e, b, total)

    @wp.kernel(module="unique", enable_backward=False)
    def product(
        u: wp.array3d(dtype=real), p: wp.array3d(dtype=real), tets: wp.array2d(dtype=wp.int32),
        corners: wp.array2d(dtype=wp.int32), shapes: wp.array2d(dtype=real), slopes: wp.array4d(dtype=real),
        weights: wp.array2d(dtype=real), slab: wp.array(dtype=wp.int32), thickness: wp.array(dtype=real),
        m: wp.array2d(dtype=real), average: wp.array2d(dtype=real), change: wp.array2d(dtype=real),
        modulus: wp.array(dtype=real), total: wp.array3d(dtype=real),
    ):
        e, b = wp.tid()
        values, along = gather(u, tets, e, b), gather(p, tets, e, b)
        result, c, s = Nodal(), constants(m, b), stretch(slab, thickness, e, b)
        averages, changes = at_corners(average, corners, e, b), at_corners(change, corners, e, b)
        kappa = bulk_of(c)
        most = bearable * modulus[b] / kappa
        for q in range(4):
            H, D = gradient(values, slopes, e, q, s), gradient(along, slopes, e, q, s)
            K = cofactor_change(H)
            cof = shifted(K, real(1.0))
            # Half-way through Newton's method pressures are far beyond any that will stay, and would turn the tangent
            # indefinite.
            excess = wp.clamp(at_point(averages, shapes, q), -most, most) - volume_change(H, K)
            onward = at_point(changes, shapes, q) - wp.ddot(cof, D)
            dP = tangent_of(H, D, c) + kappa * (onward * cof + excess * cross(shifted(H, real(1.0)), D))
            dP = dP * (weights[e, q] * s)
            for a in range(10):
                f = dP * slope(slopes, e, q, a, s)
                for i in range(3):
                    result[a, i] = result[a, i] + f[i]
        add(result, tets, e, b, total)

    @wp.kernel(module="unique", enable_backward=False)
    def energy(
        u: wp.array3d(dtype=real), tets: wp.array2d(dtype=wp.int32), corners: wp.array2d(dtype=wp.int32),
        shapes: wp.array2d(dtype=real), slopes: wp.array4d(dtype=real), weights: wp.array2d(dtype=real),
        slab: wp.array(dtype=wp.int32), thickness: wp.array(dtype=real), m: wp.array2d(dtype=real),
        average: wp.array2d(dtype=real), total: wp.array(dtype=real),
    ):
        e, b = wp.tid()
        values, c = gather(u, tets, e, b), constants(m, b)
        s, averages = stretch(slab, thickness, e, b), at_corners(average, corners, e, b)
        for q in range(4):
            H = gradient(values, slopes, e, q, s)
            j = volume_change(H, cofactor_change(H))
            extra = real(0.5) * bulk_of(c) * j * (at_point(averages, shapes, q) - j)
            wp.atomic_add(total, b, (energy_of(H, c) + extra) * (weights[e, q] * s))

    return SimpleNamespace(
        swelling=swelling, swelling_change=swelling_change, force=force, product=product, energy=energy
    )
