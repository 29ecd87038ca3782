"""Whether the strains of a solved press stay where its material law is stable; beyond, an equilibrium means nothing."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from tacdata.errors import SolveError
from tacdata.sensor import Material
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.validity.law_stability import instabilities, unstable


class StableStrain:
    """Checks states of one mesh and law; costs nothing for laws that are stable everywhere."""

    def __init__(self, mesh: SkinMesh, material: Material) -> None:
        """Test the law along the usual paths (`tacdata.skin.validity.law_stability`)."""
        self._mesh, self._material = mesh, material
        self.remarks = tuple(instabilities(material))
        """In words, where the law is unstable between half and twice the length; empty if nowhere."""

    @cached_property
    def _slopes(self) -> np.ndarray:
        return self._mesh.shape_gradients()[0]

    def strains(self, displacement: np.ndarray) -> np.ndarray:
        """Return the isochoric principal logarithmic strains [1] at the quadrature points, shape (elements, 4, 3).

        Args:
            displacement: Of the nodes [mm], shape (nodes, 3).
        """
        gradient = np.einsum("eai,eqaj->eqij", displacement[self._mesh.tets], self._slopes) + np.eye(3)
        # The eigenvalues of C = F^T F are the squares of the stretches.
        square = np.linalg.eigvalsh(np.einsum("eqki,eqkj->eqij", gradient, gradient))
        strain = 0.5 * np.log(square)
        return strain - strain.mean(axis=-1, keepdims=True)

    def check(self, depth: float, displacement: np.ndarray) -> None:
        """Refuse a state in which the law is unstable anywhere.

        Args:
            depth: Of the press [mm].
            displacement: Of the nodes [mm], shape (nodes, 3).

        Raises:
            SolveError: With the place and how far the skin is stretched there.
        """
        if not self.remarks:
            return
        strains = self.strains(displacement).reshape(-1, 3)
        bad = np.flatnonzero(unstable(self._material, strains))
        if not len(bad):
            return
        worst = bad[np.abs(strains[bad]).max(axis=1).argmax()]
        # There are four quadrature points an element.
        place = self._mesh.nodes[self._mesh.tets[worst // 4, :4]].mean(axis=0).round(2).tolist()
        # The eigenvalues, hence the strains, are in ascending order.
        low, high = np.exp(strains[worst][[0, 2]])
        raise SolveError(
            f"at {depth:g} mm depth, material law {self._material.law} is unstable in {len(bad)} of {len(strains)} "
            f"points, worst at {place} mm where the skin is stretched by {low:.2f} and {high:.2f}; {self.remarks[0]}",
            "strains within the law's stable range",
            "correct material/parameters in the sensor file, choose another law, or press less deep",
        )
