"""The kernels of a batch on a GPU, which are compiled side by side and ship in a wheel."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import torch

from tacdata.skin.contact import kernels as contact
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.contact.mortar import product_kernel
from tacdata.skin.contact.passage_check import passage_kernel
from tacdata.skin.elasticity.averaged_kernels import averaged_kernels
from tacdata.skin.elasticity.averaged_volume import mass_kernel
from tacdata.skin.elasticity.body import Elasticity, element_kernels
from tacdata.skin.linear import constraint_kernels, cuda_cg_kernels
from tacdata.skin.linear.sweep_kernels import invert_kernel, sweep_kernels
from tacdata.warp_runtime import wp

_WORK, _EXACT = wp.float32, wp.float64
"""Precisions of products with the tangent, and of forces."""


def batch_kernels(body: Elasticity, surfaces: Sequence[ContactSurface]) -> Iterator[wp.Kernel]:
    """Yield the kernels that a batch of this body and these contacts needs on a GPU."""
    if body.averages:
        work, exact = (averaged_kernels(body.law, real) for real in (_WORK, _EXACT))
        yield from (exact.force, exact.dilatation, work.dilatation, work.dilatation_change, work.product)
        yield from map(mass_kernel, (_WORK, _EXACT))
    else:
        yield element_kernels(body.law, _EXACT).internal_force
        yield element_kernels(body.law, _WORK).tangent_product
    for surface in surfaces:
        for distance in surface.distances.values():
            yield contact.pressure_kernel(distance)
            if not surface.flat:
                yield from (contact.gap_kernel(distance), passage_kernel(distance))
        if not surface.flat:
            yield contact.turn_kernel(_WORK)
        if surface.rough:
            yield contact.slip_kernel(_WORK)
    yield from map(product_kernel, (_WORK, _EXACT))
    sweeps = sweep_kernels(torch.float32)
    yield from (contact.friction, constraint_kernels.along, cuda_cg_kernels.advance)
    yield from (invert_kernel(_WORK, "float"), sweeps.take, sweeps.put, sweeps.unfold)
