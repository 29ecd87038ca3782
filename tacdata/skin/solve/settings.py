"""Numerical settings of the skin model."""

from __future__ import annotations

from dataclasses import dataclass, field

from tacdata.errors import UsageError
from tacdata.sensor import Material
from tacdata.skin.mesh.generation.settings import MeshSettings

_USUAL = 16.5
"""Bulk over shear modulus up to which volumetric energy does not hide the rest [1]: Poisson's ratio 0.47."""


@dataclass(frozen=True)
class SolverSettings:
    """When an equilibrium counts as found."""

    residual: float = 5e-4
    """Out-of-balance force over the largest contact force, Euclidean norms over the nodes [1]."""
    penetration: float = 3e-3
    """Largest mean |gap| of a node that carries load over the indentation depth [1]."""
    mean_penetration: float = 3e-4
    """Mean |gap|, weighted by the load that nodes carry, over the indentation depth [1]; the force is off by about one
    and a half times as much."""
    forcing: float = 0.1
    """Relative tolerance of the conjugate gradients in a Newton iteration [1]; loose, as an evaluation costs one.

    For skins up to Poisson's ratio 0.47; nearer to incompressible it is less (`forcing_for`)."""
    newton_limit: int = 60
    """Newton iterations per state before giving up."""
    patience: int = 12
    """Newton iterations without progress after which a state is given up, so that the path can try a smaller step."""
    cg_limit: int = 400
    """Conjugate-gradient iterations per Newton iteration."""

    def forcing_for(self, material: Material) -> float:
        """Return the relative tolerance of the conjugate gradients for a material [1].

        It is one of energy, most of which is volumetric where the bulk modulus K is far above the shear modulus mu.
        Contact is decided by the rest, so the tolerance falls with sqrt(mu / K) beyond `_USUAL`. At Poisson's ratio
        0.499 a deep press takes 68 Newton iterations so, and 376 with the tolerance of 0.47.
        """
        ratio = material.bulk_modulus / material.shear_modulus
        return self.forcing * min(1.0, (_USUAL / ratio) ** 0.5)


@dataclass(frozen=True)
class ModelSettings:
    """Discretization and solver of the skin model."""

    mesh: MeshSettings = field(default_factory=MeshSettings)
    solver: SolverSettings = field(default_factory=SolverSettings)
    activation: float = 10.0
    """Weight of a gap against a pressure in the active set, over Young's modulus [1/mm]."""
    stick: float = 30.0
    """Tangential stiffness of sticking nodes over Young's modulus [1/mm]."""
    step: float = 0.25
    """Longest load step [mm]."""
    averaged_from: float = 0.0
    """Poisson's ratio from which on volume changes are averaged at the corners [1]: 0 always, 0.5 never.

    See `tacdata.skin.elasticity.averaged_volume`. Laws whose volumetric part is no term of its own take volume changes
    at the points in any case."""
    error_estimate: bool = True
    """Whether `SkinModel.solve` also presses a coarser mesh, to say how far the mesh leaves the result off."""
    alone: bool = False
    """Whether each press is solved by itself, as by a new model: then its result does not depend, to the last bit, on
    the presses that are asked for with it or before it. Only on a CPU."""

    def check(self, device: str) -> None:
        """Refuse a device, "cpu" or a GPU such as "cuda:0", on which they cannot be kept.

        Raises:
            UsageError: If presses are to be solved alone, on a GPU.
        """
        if self.alone and device != "cpu":
            raise UsageError(
                f"results on {device} that are the same to the last bit in every batch",
                "device cpu: sums on a GPU have no fixed order",
                "choose device cpu, or results within the solver's tolerance",
            )
