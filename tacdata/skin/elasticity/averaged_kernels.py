"""Kernels of a body whose volume changes are averaged at the corners (`tacdata.skin.elasticity.averaged_volume`).

Each element reads its nodes once and adds to them once: on a GPU it is these accesses that cost, not the arithmetic.
"""

from functools import cache
from types import SimpleNamespace

from tacdata.skin.constitutive import kinematics
from tacdata.skin.elasticity.element_functions import constant_data, element_data, element_functions
from tacdata.skin.materials import load_law
from tacdata.warp_runtime import wp

BEARABLE = 1.0
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
    ElementData, ConstantData = element_data(real), constant_data(real)
    of_element = element_functions(real)
    gather, gradient, forces, add = of_element.gather, of_element.gradient, of_element.forces, of_element.add
    constants, stretch, Nodal = of_element.constants, of_element.stretch, of_element.Nodal
    bearable = wp.constant(real(BEARABLE))
    Four = wp.types.vector(4, real)

    @wp.func
    def at_corners(field: wp.array2d(dtype=real), mesh: ElementData, e: int, b: int):
        values = Four()
        for a in range(4):
            values[a] = field[mesh.corners[e, a], b]
        return values

    @wp.func
    def at_point(values: Four, mesh: ElementData, q: int):
        value = real(0.0)
        for a in range(4):
            value += mesh.shapes[q, a] * values[a]
        return value

    @wp.kernel(module="unique", enable_backward=False)
    def dilatation(u: wp.array3d(dtype=real), mesh: ElementData, material: ConstantData, sums: wp.array2d(dtype=real)):
        """Volume change of one element, weighted by its corners' shape functions."""
        e, b = wp.tid()
        values, s = gather(u, mesh, e, b), stretch(mesh, material, e, b)
        total = Four()
        for q in range(4):
            H = gradient(values, mesh, e, q, s)
            j = volume_change(H, cofactor_change(H)) * (mesh.weights[e, q] * s)
            for a in range(4):
                total[a] = total[a] + mesh.shapes[q, a] * j
        for a in range(4):
            wp.atomic_add(sums, mesh.corners[e, a], b, total[a])

    @wp.kernel(module="unique", enable_backward=False)
    def dilatation_change(
        u: wp.array3d(dtype=real),
        p: wp.array3d(dtype=real),
        mesh: ElementData,
        material: ConstantData,
        sums: wp.array2d(dtype=real),
    ):
        """The same for the change of volume change along ``p``."""
        e, b = wp.tid()
        values, along = gather(u, mesh, e, b), gather(p, mesh, e, b)
        s, total = stretch(mesh, material, e, b), Four()
        for q in range(4):
            cof = shifted(cofactor_change(gradient(values, mesh, e, q, s)), real(1.0))
            j = wp.ddot(cof, gradient(along, mesh, e, q, s)) * (mesh.weights[e, q] * s)
            for a in range(4):
                total[a] = total[a] + mesh.shapes[q, a] * j
        for a in range(4):
            wp.atomic_add(sums, mesh.corners[e, a], b, total[a])

    @wp.kernel(module="unique", enable_backward=False)
    def force(
        u: wp.array3d(dtype=real),
        mesh: ElementData,
        material: ConstantData,
        average: wp.array2d(dtype=real),
        smallest: wp.array(dtype=real),
        total: wp.array3d(dtype=real),
    ):
        """Nodal forces of one element, and the smallest det F."""
        e, b = wp.tid()
        values, result, c = gather(u, mesh, e, b), Nodal(), constants(material, b)
        s, kappa, averages = stretch(mesh, material, e, b), bulk_of(c), at_corners(average, mesh, e, b)
        least = real(1.0e30)
        for q in range(4):
            H = gradient(values, mesh, e, q, s)
            least = wp.min(least, wp.determinant(wp.identity(n=3, dtype=real) + H))
            K = cofactor_change(H)
            # The law's stress has kappa j cof F of the point's own j; the average replaces that j.
            excess = kappa * (at_point(averages, mesh, q) - volume_change(H, K))
            P = (stress_of(H, c) + excess * shifted(K, real(1.0))) * (mesh.weights[e, q] * s)
            result += forces(P, mesh, e, q, s)
        wp.atomic_min(smallest, b, least)
        add(result, mesh, e, b, total)

    @wp.kernel(module="unique", enable_backward=False)
    def product(
        u: wp.array3d(dtype=real),
        p: wp.array3d(dtype=real),
        mesh: ElementData,
        material: ConstantData,
        average: wp.array2d(dtype=real),
        change: wp.array2d(dtype=real),
        total: wp.array3d(dtype=real),
    ):
        """Tangent stiffness of one element times nodal displacements ``p``.

        1. Averaged volume change at the point, and its change along ``p``.
        2. Change of the law's stress, and of the pressure by which the average differs from the point's own.
        3. Nodal forces.
        """
        e, b = wp.tid()
        values, along = gather(u, mesh, e, b), gather(p, mesh, e, b)
        result, c, s = Nodal(), constants(material, b), stretch(mesh, material, e, b)
        averages, changes = at_corners(average, mesh, e, b), at_corners(change, mesh, e, b)
        kappa = bulk_of(c)
        limit = bearable * material.modulus[b] / kappa
        for q in range(4):
            H, D = gradient(values, mesh, e, q, s), gradient(along, mesh, e, q, s)
            K = cofactor_change(H)
            cof = shifted(K, real(1.0))
            # Half-way through Newton's method pressures are far beyond any that will stay, and would turn the tangent
            # indefinite.
            excess = wp.clamp(at_point(averages, mesh, q), -limit, limit) - volume_change(H, K)
            onward = at_point(changes, mesh, q) - wp.ddot(cof, D)
            dP = tangent_of(H, D, c) + kappa * (onward * cof + excess * cross(shifted(H, real(1.0)), D))
            dP = dP * (mesh.weights[e, q] * s)
            result += forces(dP, mesh, e, q, s)
        add(result, mesh, e, b, total)

    @wp.kernel(module="unique", enable_backward=False)
    def energy(
        u: wp.array3d(dtype=real),
        mesh: ElementData,
        material: ConstantData,
        average: wp.array2d(dtype=real),
        total: wp.array(dtype=real),
    ):
        """Strain energy of one element."""
        e, b = wp.tid()
        values, c = gather(u, mesh, e, b), constants(material, b)
        s, averages = stretch(mesh, material, e, b), at_corners(average, mesh, e, b)
        for q in range(4):
            H = gradient(values, mesh, e, q, s)
            j = volume_change(H, cofactor_change(H))
            # Summed over the points, w j times the average is b^T Q b.
            extra = real(0.5) * bulk_of(c) * j * (at_point(averages, mesh, q) - j)
            wp.atomic_add(total, b, (energy_of(H, c) + extra) * (mesh.weights[e, q] * s))

    return SimpleNamespace(
        dilatation=dilatation, dilatation_change=dilatation_change, force=force, product=product, energy=energy
    )
