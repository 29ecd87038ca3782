"""Weighted means under piecewise linear hats: what they reproduce, how they spread forces, and that no mode is lost."""

import numpy as np
import pytest
import scipy.linalg
import torch
from skin_examples import batch, box_mesh, slab_sensor

from tacdata.skin.contact.contact_surface import SUBDIVISIONS, face_quadrature
from tacdata.skin.contact.mortar import Mortar
from tacdata.skin.mesh import elements

CELLS = 6
SPACING = 4.0 / CELLS / 2
"""Of the nodes on the face [mm]."""
POINTS, WEIGHTS = elements.triangle_quadrature(SUBDIVISIONS)


class Face:
    """The outer face of a mesh, and the projection onto its hats."""

    def __init__(self, mesh):
        self.mesh, self.faces, self.nodes = mesh, mesh.outer, mesh.nodes
        weights, shapes = face_quadrature(torch.as_tensor(mesh.nodes), torch.as_tensor(mesh.outer), SUBDIVISIONS)
        self.weights, self.shapes, self.hats = weights.numpy(), shapes.numpy(), elements.triangle_hats(POINTS)
        self.mortar = Mortar(mesh.outer, self.weights, self.shapes, self.hats, len(mesh.nodes), "cpu")
        self.places = mesh.nodes[self.mortar.nodes]
        self.inside = np.abs(self.places[:, :2]).max(axis=1) < np.abs(self.nodes[:, 0]).max() - 1e-9

    def means(self, field):
        """Means of one scalar field at the mesh's nodes, shape (s,)."""
        return self.mortar.means(batch(np.stack([field, 0 * field, 0 * field], axis=-1)))[:, 0, 0].numpy()

    def products(self, left, right):
        """Integrals over the face of products of two sets of functions given at the points, shape (s, s)."""
        local = np.einsum("fk,ka,kb->fab", self.weights, left, right)
        whole = np.zeros((len(self.places), len(self.places)))
        for slots, block in zip(self.mortar.slots, local, strict=True):
            whole[np.ix_(slots, slots)] += block
        return whole


@pytest.fixture(scope="module")
def face():
    return Face(box_mesh(slab_sensor(size=4.0), CELLS, CELLS, 2))


def test_hats_share_every_point_of_the_triangle():
    """They sum to 1, are never negative, are 1 at their own node alone, and give linear functions back."""
    random = np.random.default_rng(0).dirichlet([1, 1, 1], size=500)[:, 1:]
    nodes = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
    assert elements.triangle_hats(nodes) == pytest.approx(np.eye(6), abs=1e-15)
    for points in (random, POINTS):
        found = elements.triangle_hats(points)
        assert found.sum(axis=1) == pytest.approx(np.ones(len(points)), abs=1e-14)
        assert found.min() >= 0
        assert found @ nodes == pytest.approx(points, abs=1e-14)


def test_hats_are_linear_on_each_of_four_triangles():
    """Half-way between two points of one of them they are half-way, and over two of them they bend."""
    parts = [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]
    nodes = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
    random = np.random.default_rng(1)
    for part in parts:
        a, b = (random.dirichlet([1, 1, 1], size=50) @ nodes[part] for _ in range(2))
        middle = (elements.triangle_hats(a) + elements.triangle_hats(b)) / 2
        assert elements.triangle_hats((a + b) / 2) == pytest.approx(middle, abs=1e-14)
    ends = elements.triangle_hats(np.array([[0.0, 0.0], [1.0, 0.0]]))
    assert elements.triangle_hats(np.array([[0.5, 0.0]]))[0, 3] == 1.0 and not ends[:, 3].any()


def test_the_areas_of_hats_are_those_of_the_lattice(face):
    assert face.mortar.area.sum() == pytest.approx(16, rel=1e-12)
    assert face.mortar.area[face.inside] == pytest.approx(np.full(face.inside.sum(), SPACING**2), rel=1e-12)
    assert face.mortar.area.min() > 0


def test_means_give_back_constants_and_linear_fields(face):
    assert face.means(np.full(len(face.nodes), 0.7)) == pytest.approx(np.full(len(face.places), 0.7), rel=1e-14)
    slope = np.array([0.3, -0.8, 0.0])
    found = face.means(0.1 + face.nodes @ slope)
    assert found[face.inside] == pytest.approx(0.1 + face.places[face.inside] @ slope, abs=1e-13)


def test_means_of_quadratic_fields_add_the_spread_of_the_hat(face):
    """That of a lattice's hat is h^2 / 6 along each axis: a box as wide as the spacing, and one along the diagonal."""
    x, y = face.nodes[:, :2].T
    at_x, at_y = face.places[face.inside, :2].T
    for field, wanted in ((x * x, at_x**2 + SPACING**2 / 6), (y * y, at_y**2 + SPACING**2 / 6)):
        assert face.means(field)[face.inside] == pytest.approx(wanted, abs=1e-13)
    along = face.means(x * y)[face.inside] - at_x * at_y
    assert np.abs(along) == pytest.approx(np.full(len(along), SPACING**2 / 12), abs=1e-13)


def test_forces_are_spread_with_the_work_that_they_do_on_means(face):
    """The resultant stays, so does the moment, and f . M u = M^T f . u for every u."""
    random = np.random.default_rng(2)
    u, forces = batch(random.normal(size=face.nodes.shape)), batch(random.normal(size=face.places.shape))
    spread = torch.zeros_like(u)
    face.mortar.spread(forces, spread)
    assert spread.sum(dim=0).numpy() == pytest.approx(forces.sum(dim=0).numpy(), abs=1e-12)
    assert (spread * u).sum().item() == pytest.approx((forces * face.mortar.means(u)).sum().item(), rel=1e-12)
    inner = batch(np.where(face.inside[:, None], forces[..., 0], 0.0))
    moved = torch.zeros_like(u)
    face.mortar.spread(inner, moved)
    for axis in (0, 1):
        moment = face.nodes[:, axis] @ moved[:, 2, 0].numpy()
        assert moment == pytest.approx(face.places[:, axis] @ inner[:, 2, 0].numpy(), abs=1e-12)


def test_spreading_adds_to_what_is_there_and_works_in_single_precision(face):
    forces = batch(np.random.default_rng(3).normal(size=face.places.shape))
    once, twice, single = (
        torch.zeros(len(face.nodes), 3, 1, dtype=kind) for kind in (torch.float64, torch.float64, torch.float32)
    )
    face.mortar.spread(forces, once)
    face.mortar.spread(forces, twice)
    face.mortar.spread(forces, twice)
    face.mortar.spread(forces.float(), single)
    assert torch.equal(twice, 2 * once)
    assert (single.double() - once).abs().max() < 1e-6 * once.abs().max()
    assert face.mortar.means(single).dtype == torch.float32


def infsup(face):
    """The least over pressures p of the largest over displacements v of (p, v) / |p| |v|, with v quadratic [1].

    It is the smallest singular value of the mortar matrix, scaled by the mass matrices of hats and displacements.
    """
    of_hats, of_shapes, mixed = (
        face.products(*pair) for pair in ((face.hats, face.hats), (face.shapes, face.shapes), (face.hats, face.shapes))
    )
    rows, columns = np.linalg.cholesky(of_hats), np.linalg.cholesky(of_shapes)
    half = scipy.linalg.solve_triangular(rows, mixed, lower=True)
    scaled = scipy.linalg.solve_triangular(columns, half.T, lower=True)
    assert np.abs(mixed / face.mortar.area[:, None] - face.mortar.mean[:, face.mortar.nodes]).max() < 1e-12
    return np.linalg.svd(scaled, compute_uv=False).min()


LEAST = np.sqrt(6 / 7)
"""The inf-sup constant of hats against quadratic displacements on one triangle, and so a bound for any mesh [1]."""


def test_no_pressure_is_without_effect_however_fine_the_mesh():
    found = np.array([infsup(Face(box_mesh(slab_sensor(size=4.0), n, n, 1))) for n in (1, 2, 4, 6)])
    assert found == pytest.approx(np.full(4, LEAST), rel=1e-9)


def test_no_pressure_is_without_effect_on_a_mesh_of_a_mesher(slab):
    assert LEAST - 1e-9 < infsup(Face(slab.mesh)) < 1
