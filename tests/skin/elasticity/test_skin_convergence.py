"""Rates of convergence against an exact solution: Kelvin's point force, seen from outside.

The field of a point force in an infinite body (Love 1927, section 130) satisfies the equations of linear elasticity
without body force everywhere but at the point, which here lies 1.5 mm below the box. Its values are held on the whole
surface; inside, quadratic tetrahedra must find it with an error falling as h^3 (displacement) and h^2 (gradient).
"""

import numpy as np
import scipy.sparse as sp
import torch
from skin_examples import batch, box_mesh, conical_rule, slab_sensor, tetrahedron_shapes

from tacdata.sensor.sensor import Material
from tacdata.skin.elasticity.body import Elasticity
from tacdata.skin.linear.rest_stiffness import rest_solver
from tacdata.skin.member.conditions import conditions
from tacdata.skin.mesh import elements

MATERIAL = Material("neo_hookean", 0.30, 0.47)
PLACE = np.array([0.3, -0.2, -1.5])
FORCE = 1e-6 * np.array([0.5, 0.3, 1.0])
"""Small, so that the strains (about 1e-6) keep the large-strain law linear."""


def kelvin(x):
    r = x - PLACE
    d = np.linalg.norm(r, axis=-1, keepdims=True)
    nu, mu = MATERIAL.poisson_ratio, MATERIAL.shear_modulus
    along = (r * FORCE).sum(axis=-1, keepdims=True) * r / d**2
    return ((3 - 4 * nu) * FORCE + along) / (16 * np.pi * mu * (1 - nu) * d)


def kelvin_gradient(x):
    h = 1e-4
    columns = [(kelvin(x + h * e) - kelvin(x - h * e)) / (2 * h) for e in np.eye(3)]
    return np.stack(columns, axis=-1)


def solve(cells):
    """Equilibrium by the kernels' own internal force, corrected with the rest stiffness's factor."""
    mesh = box_mesh(slab_sensor(size=2.0), cells, cells, cells)
    held = mesh.sides | (np.abs(mesh.nodes[:, 2]) < 1e-9) | (np.abs(mesh.nodes[:, 2] - 2) < 1e-9)
    rest = rest_solver(mesh, MATERIAL, held, sp.csr_matrix((0, 3 * len(mesh.nodes))), "cpu")
    body, member = Elasticity(mesh, MATERIAL.law), conditions(MATERIAL, 0.0)
    u = batch(np.where(held[:, None], kelvin(mesh.nodes), 0.0))
    for _ in range(8):
        force = body.internal_force(u, member)[0]
        size = force[torch.as_tensor(~held)].abs().max()
        u -= (rest.apply((force / size).float().reshape(-1, 1)).double() * size).reshape(u.shape)
    free = torch.as_tensor(~held)
    force = body.internal_force(u, member)[0]
    assert force[free].abs().max() < 1e-6 * force[~free].abs().max()
    return mesh, u[..., 0].numpy()


def errors(mesh, u):
    """Root mean square of the errors of displacement and gradient, relative to the fields."""
    points, weights = conical_rule(4)
    shapes, slopes = tetrahedron_shapes(points), elements.tetrahedron_gradients(points)
    nodes = mesh.nodes[mesh.tets]
    x = np.einsum("qa,eai->eqi", shapes, nodes)
    jacobian = np.einsum("eai,qaj->eqij", nodes, slopes)
    weights = weights * np.linalg.det(jacobian)
    found = np.einsum("qa,eai->eqi", shapes, u[mesh.tets])
    gradient = np.einsum("eai,qaj->eqij", u[mesh.tets], slopes) @ np.linalg.inv(jacobian)

    def norm(field):
        return np.sqrt((weights * (field**2).reshape(*weights.shape, -1).sum(axis=-1)).sum())

    exact, exact_gradient = kelvin(x), kelvin_gradient(x)
    return norm(found - exact) / norm(exact), norm(gradient - exact_gradient) / norm(exact_gradient)


def test_displacement_converges_as_h3_and_its_gradient_as_h2():
    cells = np.array([4, 6, 8])
    found = np.array([errors(*solve(n)) for n in cells])
    rates = np.log(found[:-1] / found[1:]) / np.log(cells[1:] / cells[:-1])[:, None]
    assert found[-1, 0] < 5e-4
    assert found[-1, 1] < 0.02
    assert rates[:, 0].min() > 2.8, f"displacement: errors {found[:, 0]}, rates {rates[:, 0]}"
    assert rates[:, 1].min() > 1.85, f"gradient: errors {found[:, 1]}, rates {rates[:, 1]}"
