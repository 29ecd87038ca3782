"""Small sensors, a structured mesh and law evaluation for the tests of the skin model."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.sparse as sp
import torch

from tacdata.sensor import Material, Sensor, default_sensor
from tacdata.sensor.sensor import ContactProperties, DepthMap, Skin, Taxels
from tacdata.skin.contact.contact_surface import SUBDIVISIONS, face_quadrature
from tacdata.skin.contact.mortar import Mortar
from tacdata.skin.linear.rest_stiffness import rest_stiffness
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.mesh import elements
from tacdata.skin.mesh.generation.quadratic import quadratic
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.model import ModelSettings
from tacdata.skin.solve.settings import SolverSettings
from tacdata.warp_runtime import wp

MATERIAL = Material("neo_hookean", 0.30, 0.47)

NO_CARD = pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
DEVICES = ["cpu", pytest.param("cuda:0", marks=[pytest.mark.gpu, NO_CARD])]
"""For tests that run on a card as they do without one."""

PLAIN = ModelSettings(error_estimate=False)
EXACT = ModelSettings(
    error_estimate=False,
    solver=SolverSettings(residual=1e-5, penetration=1e-4, mean_penetration=1e-5, newton_limit=200, patience=40),
)
"""So tight that two solvers of one mesh's equations must say the same: what the tolerance leaves stands elsewhere."""

Parameters = wp.types.vector(length=8, dtype=wp.float64)


def slab_sensor(size=6.0, thickness=2.0, friction=0.0, bonded=("bottom",), pixels=15) -> Sensor:
    """A plain slab [mm] with a map of ``pixels`` x ``pixels`` 0.4 mm pixels."""
    return replace(
        default_sensor(),
        name="slab",
        taxels=Taxels(1, 1, 1.0, 1.0),
        skin=Skin(size, size, thickness, 0.0),
        contact=ContactProperties(friction, bonded, False),
        map=DepthMap(pixels, pixels, 0.4, 1.0),
    )


def bumps_sensor() -> Sensor:
    """Four protrusions under a slab held at its sides, standing on a board."""
    return replace(
        default_sensor(),
        name="bumps",
        taxels=Taxels(2, 2, 2.0, 1.8),
        skin=Skin(5.0, 5.0, 2.0, 0.7),
        contact=ContactProperties(0.2, ("sides",), True),
        map=DepthMap(11, 11, 0.4, 1.0),
    )


def box_mesh(sensor: Sensor, nx: int, ny: int, nz: int) -> SkinMesh:
    """A structured mesh of a plain slab: every cell cut into six tetrahedra (Kuhn)."""
    skin = sensor.skin
    axes = [
        np.linspace(-skin.size_x / 2, skin.size_x / 2, nx + 1),
        np.linspace(-skin.size_y / 2, skin.size_y / 2, ny + 1),
        np.linspace(0, skin.thickness, nz + 1),
    ]
    return kuhn_mesh(sensor, axes)


def kuhn_mesh(sensor: Sensor, axes: list[np.ndarray]) -> SkinMesh:
    """A mesh of the boxes between lines along x, y and z, every one cut into six tetrahedra (Kuhn)."""
    nx, ny, nz = (len(axis) - 1 for axis in axes)
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    index = np.arange(len(points)).reshape(nx + 1, ny + 1, nz + 1)
    tets = []
    for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        bits, path = [0, 0, 0], []
        for axis in (None, *order):
            if axis is not None:
                bits[axis] = 1
            i, j, k = bits
            path.append(index[i : nx + i, j : ny + j, k : nz + k].ravel())
        tets.append(np.stack(path, axis=-1))
    return quadratic(sensor, points, np.concatenate(tets))


def batch(*fields: np.ndarray) -> torch.Tensor:
    """Nodal fields (n, 3), one a member, as the solver lays them out: (n, 3, b)."""
    return torch.as_tensor(np.stack(fields, axis=-1), dtype=torch.float64).contiguous()


def joined(*members: Conditions) -> Conditions:
    """Conditions of several members, made of single ones."""
    return Conditions.joined(members)


class HeldSlab:
    """A slab of 4 x 4 x 2 cells, bottom held, contact possible on its outer face: rest stiffness and mortar rows."""

    def __init__(self) -> None:
        """Mesh and assemble."""
        self.mesh = box_mesh(slab_sensor(size=4.0), 4, 4, 2)
        self.count = len(self.mesh.nodes)
        self.stiffness = rest_stiffness(self.mesh, MATERIAL)
        self.free = np.flatnonzero(~np.repeat(self.mesh.bottom, 3))
        self.held = np.setdiff1d(np.arange(3 * self.count), self.free)
        nodes, faces = torch.as_tensor(self.mesh.nodes), torch.as_tensor(self.mesh.outer)
        weights, shapes = face_quadrature(nodes, faces, SUBDIVISIONS)
        at_points = elements.triangle_hats(elements.triangle_quadrature(SUBDIVISIONS)[0])
        mortar = Mortar(self.mesh.outer, weights.numpy(), shapes.numpy(), at_points, self.count, "cpu")
        self.rows = sp.csr_matrix(sp.kron(mortar.mean, np.eye(3)))

    def random(self, *seeds: int) -> torch.Tensor:
        """Random fields (3n, b), zero where held, float32, one for each seed."""
        field = np.stack([np.random.default_rng(seed).normal(size=3 * self.count) for seed in seeds], axis=-1)
        field[self.held] = 0
        return torch.as_tensor(field).float()

    def times(self, x: torch.Tensor) -> torch.Tensor:
        """The rest stiffness times fields (3n, b), on free degrees of freedom, float64."""
        r = torch.as_tensor(self.stiffness @ x.double().numpy())
        r[self.held] = 0
        return r


def tetrahedron_shapes(points: np.ndarray) -> np.ndarray:
    """The 10 shape functions at (xi, eta, zeta), shape (q, 10), written anew from the barycentric coordinates."""
    b = np.concatenate([1 - points.sum(axis=1, keepdims=True), points], axis=1)
    edges = [4 * b[:, i] * b[:, j] for i, j in elements.EDGES]
    return np.concatenate([b * (2 * b - 1), np.stack(edges, axis=-1)], axis=-1)


def conical_rule(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss' rule on the cube collapsed onto the tetrahedron: n^3 points, exact to degree 2n - 3."""
    x, w = np.polynomial.legendre.leggauss(n)
    x, w = (x + 1) / 2, w / 2
    a, b, c = (g.ravel() for g in np.meshgrid(x, x, x, indexing="ij"))
    weights = np.einsum("i,j,k->ijk", w, w, w).ravel() * (1 - a) ** 2 * (1 - b)
    return np.stack([a, b * (1 - a), c * (1 - a) * (1 - b)], axis=-1), weights


def evaluate(law, material, F: np.ndarray, dF: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Energy (n,), stress (n, 3, 3) and tangent along dF (n, 3, 3) of a law, by its own Warp functions."""
    values = law.parameters(material)
    n = len(F)
    energy = wp.zeros(n, dtype=wp.float64, device="cpu")
    stress, tangent = (wp.zeros(n, dtype=wp.mat33d, device="cpu") for _ in range(2))
    wp.launch(
        _law_kernel(type(law)),
        dim=n,
        inputs=[
            wp.array(F, dtype=wp.mat33d, device="cpu"),
            wp.array(dF, dtype=wp.mat33d, device="cpu"),
            Parameters(*values, *([0.0] * (8 - len(values)))),
        ],
        outputs=[energy, stress, tangent],
        device="cpu",
    )
    return energy.numpy(), stress.numpy(), tangent.numpy()


@cache
def _law_kernel(kind):
    law = kind()
    energy_of, stress_of, tangent_of = law.energy_function(), law.stress_function(), law.tangent_function()

    @wp.kernel(module="unique", enable_backward=False)
    def values(
        F: wp.array(dtype=wp.mat33d),
        dF: wp.array(dtype=wp.mat33d),
        m: Parameters,
        energy: wp.array(dtype=wp.float64),
        stress: wp.array(dtype=wp.mat33d),
        tangent: wp.array(dtype=wp.mat33d),
    ):
        i = wp.tid()
        energy[i] = energy_of(F[i], m)
        stress[i] = stress_of(F[i], m)
        tangent[i] = tangent_of(F[i], dF[i], m)

    return values


def random_rotation(random: np.random.Generator) -> np.ndarray:
    """A rotation matrix."""
    q, r = np.linalg.qr(random.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)
