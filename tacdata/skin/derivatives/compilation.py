"""The kernels of derivatives on a GPU; those of the press are in `tacdata.skin.solve.compilation`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.derivatives.contact_kernel import friction_change, normal_change_kernel
from tacdata.skin.elasticity.averaged_kernels import averaged_kernels
from tacdata.skin.elasticity.body import Elasticity, element_kernels
from tacdata.skin.surface.depth_map_kernel import HIGHEST
from tacdata.warp_runtime import wp


def derivative_kernels(body: Elasticity, surfaces: Sequence[ContactSurface]) -> Iterator[wp.Kernel]:
    """Yield the kernels that derivatives of presses of this body and these contacts need on a GPU."""
    if body.averages:
        exact = averaged_kernels(body.law, wp.float64)
        yield from (exact.dilatation_change, exact.product)
    else:
        yield element_kernels(body.law, wp.float64).tangent_product
    for surface in surfaces:
        yield from map(normal_change_kernel, surface.distances.values())
    yield from (friction_change, HIGHEST["cuda"])
