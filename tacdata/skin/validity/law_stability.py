"""Whether a law stays stable under the usual tests: work of every further incompressible stretch is positive.

Drucker's criterion as finite-element codes apply it: d tau : d eps > 0 for every isochoric change of the principal
logarithmic strains, along uniaxial, equibiaxial and planar paths (Abaqus Analysis User's Guide, "Hyperelastic behavior
of rubberlike materials", Drucker stability).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.sensor import Material
from tacdata.skin.materials.law import load_law
from tacdata.skin.validity.law_evaluation import evaluate

PATHS = {"uniaxial": (1.0, -0.5, -0.5), "equibiaxial": (1.0, 1.0, -2.0), "planar": (1.0, -1.0, 0.0)}
"""Principal logarithmic strains per logarithm of the nominal stretch [1]."""

STEPS = 60
"""Stretches tried in either direction on each path."""


@dataclass(frozen=True)
class StableRange:
    """Where a path is stable."""

    path: str
    """Its name."""
    lowest: float
    """Least nominal stretch up to which every state is stable [1]."""
    highest: float
    """Largest nominal stretch up to which every state is stable [1]."""


def stable_ranges(material: Material, stretch: float = 2.0) -> list[StableRange]:
    """Return the stable range of each path, searched from 1/``stretch`` to ``stretch`` [1].

    Raises:
        UsageError: If there is no such law.
        FormatError: If a parameter of the law is unknown or out of its range.
    """
    law = load_law(material.law)
    numbers = law.parameters(material)
    steps = np.linspace(0.0, np.log(stretch), STEPS + 1)
    result = []
    for name, path in PATHS.items():
        ends = []
        for sign in (-1.0, 1.0):
            stable = _least_stiffness(law, numbers, sign * steps[:, None] * np.array(path)) > 0
            unstable = np.flatnonzero(~stable)
            # A stable stretch behind an unstable one does not count: loading would have to pass through the unstable
            # one.
            last = unstable[0] - 1 if len(unstable) else STEPS
            ends.append(float(np.exp(sign * steps[last])) if last >= 0 else 1.0)
        result.append(StableRange(name, *ends))
    return result


def instabilities(material: Material, stretch: float = 2.0) -> list[str]:
    """Return in words which paths lose stability between 1/``stretch`` and ``stretch`` [1]; empty if none does.

    Raises:
        UsageError: If there is no such law.
        FormatError: If a parameter of the law is unknown or out of its range.
    """
    values = ", ".join(f"{name} = {value}" for name, value in material.parameters.items()) or "its defaults"
    words = []
    for limit in stable_ranges(material, stretch):
        bad = [f"below {limit.lowest:.2f}"] if limit.lowest > 1.0001 / stretch else []
        bad += [f"above {limit.highest:.2f}"] if limit.highest < 0.9999 * stretch else []
        if bad:
            words.append(
                f"material law {material.law} with {values} is unstable under {limit.path} stretch {' and '.join(bad)} "
                f"(tested from {1 / stretch:.2f} to {stretch:.2f})"
            )
    return words


def unstable(material: Material, strains: np.ndarray) -> np.ndarray:
    """Return where a law is unstable, shape (n,), bool, at isochoric principal logarithmic strains [1], shape (n, 3).

    Raises:
        UsageError: If there is no such law.
        FormatError: If a parameter of the law is unknown or out of its range.
    """
    law = load_law(material.law)
    # Written as "not above 0", so that a NaN counts as unstable.
    return ~(_least_stiffness(law, law.parameters(material), strains) > 0)


def _least_stiffness(law, numbers: tuple[float, ...], strains: np.ndarray) -> np.ndarray:
    """Return the least d tau : d eps / |d eps|^2 over isochoric changes [MPa], shape (n,), at log strains (n, 3)."""
    stretches = np.exp(strains)
    # Two orthonormal changes span all isochoric ones, so that the 2 x 2 stiffness below covers every direction.
    basis = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / np.sqrt([[2.0], [6.0]])
    F = stretches[:, :, None] * np.eye(3)
    responses = []
    for change in basis:
        # Strains are logarithmic: d l_i = l_i d eps_i.
        rate = stretches * change
        values = evaluate(law, numbers, F, rate[:, :, None] * np.eye(3))
        stress, tangent = (np.einsum("nii->ni", a) for a in (values.stress, values.tangent))
        # Kirchhoff stress tau_i = l_i P_i
        responses.append(rate * stress + stretches * tangent)
    stiffness = np.einsum("bi,cni->nbc", basis, np.stack(responses))
    # The sign of d tau : d eps depends on the symmetric part alone.
    return np.linalg.eigvalsh((stiffness + stiffness.transpose(0, 2, 1)) / 2)[:, 0]
