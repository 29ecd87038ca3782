"""A law at given states, from Python: by the same Warp functions as in the element kernels."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from tacdata.skin.constitutive import kinematics
from tacdata.skin.materials.law import Gradient, Law
from tacdata.warp_runtime import ON_CPU, wp


@dataclass(frozen=True)
class LawValues:
    """Values of a law at n states."""

    energy: np.ndarray
    """W per undeformed volume [MPa], shape (n,)."""
    stress: np.ndarray
    """First Piola-Kirchhoff stress P [MPa], shape (n, 3, 3)."""
    tangent: np.ndarray
    """Change of P along dF [MPa], shape (n, 3, 3)."""


def evaluate(
    law: Law,
    numbers: Sequence[float],
    gradient: np.ndarray,
    direction: np.ndarray | None = None,
    real: type = wp.float64,
    of: Gradient = "F",
    device: str = "cpu",
) -> LawValues:
    """Evaluate a law.

    Args:
        law: The law.
        numbers: At most 8, from `Law.parameters`.
        gradient: Deformation gradient F, or with ``of="H"`` displacement gradient H = F - I [1], shape (n, 3, 3).
        direction: Change dF along which tangents are wanted [1], same shape; the gradient itself if left out.
        real: ``wp.float64`` or ``wp.float32``.
        of: Meaning of ``gradient``.
        device: Where: "cpu" or "cuda:0".
    """
    mat33, n = kinematics.matrix(real), len(gradient)
    scalar = np.float64 if real is wp.float64 else np.float32
    state = np.asarray(gradient, dtype=scalar)
    change = state if direction is None else np.asarray(direction, dtype=scalar)
    # Same as `Law.stress_function` with F: exact near rest in any precision.
    displacement = state if of == "H" else state - np.eye(3, dtype=scalar)
    states = [wp.array(a, dtype=mat33, device=device) for a in (displacement, change)]
    energy = wp.zeros(n, dtype=real, device=device)
    outputs = [wp.zeros(n, dtype=mat33, device=device) for _ in range(2)]
    m = kinematics.parameters(real)(*numbers, *([0.0] * (8 - len(numbers))))
    wp.launch(_kernel(type(law), real), dim=n, inputs=[*states, m], outputs=[energy, *outputs], device=device)
    return LawValues(energy.numpy(), *(a.numpy() for a in outputs))


@cache
def _kernel(kind: type[Law], real: type) -> wp.Kernel:
    mat33, numbers = kinematics.matrix(real), kinematics.parameters(real)
    energy_of, stress_of, tangent_of = kind.functions(real)

    @wp.kernel(module="unique", module_options=ON_CPU, enable_backward=False)
    def values(
        H: wp.array(dtype=mat33),
        D: wp.array(dtype=mat33),
        m: numbers,
        energy: wp.array(dtype=real),
        stress: wp.array(dtype=mat33),
        tangent: wp.array(dtype=mat33),
    ):
        i = wp.tid()
        energy[i] = energy_of(H[i], m)
        stress[i] = stress_of(H[i], m)
        tangent[i] = tangent_of(H[i], D[i], m)

    return values
