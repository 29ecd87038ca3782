"""Whole presses on the CPU by a GPU's way: shrinking batches, a dense inverse in half precision."""

from dataclasses import replace

import numpy as np
import pytest
from skin_examples import EXACT, PLAIN, box_mesh, bumps_sensor, slab_sensor

from tacdata.indenters.flat_punch import FlatPunch
from tacdata.indenters.sphere import Sphere
from tacdata.skin.derivatives.compilation import derivative_kernels
from tacdata.skin.derivatives.press import sensitivities
from tacdata.skin.linear import constraint_preconditioner
from tacdata.skin.linear.constraint_solvers import InvertedCompliance
from tacdata.skin.linear.rest_stiffness import DenseRest, rest_stiffness
from tacdata.skin.mesh.build import MeshSettings, build_mesh
from tacdata.skin.model import SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.solve import meshed_skin
from tacdata.skin.solve.compilation import batch_kernels
from tacdata.warp_runtime import wp


@pytest.fixture
def as_on_a_gpu(monkeypatch):
    """Makes models take a GPU's way from now on."""

    def switch():
        def rest(mesh, material, fixed, rows, device, averaged):
            return DenseRest(
                rest_stiffness(mesh, material, averaged), np.flatnonzero(~np.repeat(fixed, 3)), rows, device
            )

        monkeypatch.setattr(meshed_skin, "rest_solver", rest)
        monkeypatch.setattr(constraint_preconditioner, "compliance_solver", lambda device: InvertedCompliance())

    return switch


def walked(sensor, mesh, requests):
    """Every press's states, in the order of its depths."""
    states: dict[int, list] = {number: [] for number in range(len(requests))}
    for number, _, state in SkinModel(sensor, PLAIN, mesh=mesh).states_many(requests, 4):
        states[number].append(state)
    return states


def both_ways_agree(sensor, mesh, requests, switch):
    plain = walked(sensor, mesh, requests)
    switch()
    gpu = walked(sensor, mesh, requests)
    for number, request in enumerate(requests):
        assert len(gpu[number]) == len(request.depths)
        largest = max(np.abs(state.force).max() for state in plain[number])
        for ours, theirs in zip(gpu[number], plain[number], strict=True):
            assert np.abs(ours.force - theirs.force).max() < 1e-3 * largest
            difference = ours.displacement - theirs.displacement
            assert np.sqrt((difference**2).mean()) < 2e-4 * max(request.depths)
            assert ours.residual <= PLAIN.solver.residual


def test_presses_on_a_slab_agree(as_on_a_gpu):
    sensor = slab_sensor(size=4.0, friction=0.2, pixels=9)
    places = [(1.0, -0.4, 0.4), (1.2, 0.3, 0.3), (1.5, 0.0, 0.0), (2.0, 0.1, 0.5), (1.0, 0.0, 0.2)]
    requests = [PressRequest(Sphere(radius), x, y, 0.0, (0.15, 0.3)) for radius, x, y in places]
    requests.insert(2, PressRequest(Sphere(1.5), 0.2, -0.3, 0.0, (0.2, 0.4, 0.2, 0.0)))
    both_ways_agree(sensor, box_mesh(sensor, 6, 6, 2), requests, as_on_a_gpu)


def test_all_kernels_of_a_batch_and_of_derivatives_are_known_before_them(as_on_a_gpu, monkeypatch):
    as_on_a_gpu()
    sensor = slab_sensor(size=4.0, friction=0.2, pixels=9)
    model = SkinModel(sensor, PLAIN, mesh=box_mesh(sensor, 6, 6, 2))
    requests = [PressRequest(shape, 0.0, 0.0, 0.0, (0.1,)) for shape in (Sphere(1.3), FlatPunch(0.9, 0.3))]
    body, surfaces = model.skin.body, model.skin.newton(requests).surfaces
    batch = {kernel.module for kernel in batch_kernels(body, surfaces)}
    derivatives = {kernel.module for kernel in derivative_kernels(body, surfaces)}
    used, launch = set(), wp.launch
    monkeypatch.setattr(type(body), "prepared", lambda self: None)
    monkeypatch.setattr(
        wp, "launch", lambda kernel, *more, **named: (used.add(kernel.module), launch(kernel, *more, **named))
    )
    assert len(list(model.states_many(requests, 2))) == 2
    assert len(used) > 15 and used <= batch
    assert len(list(sensitivities(model, requests[0], ["x", "youngs_modulus"]))) == 1
    assert len(used - batch) > 4 and used <= batch | derivatives


def test_labels_that_start_from_a_coarser_mesh_agree(as_on_a_gpu):
    """Starts, maps under the shape, tractions and the mesh's error, of a batch."""
    sensor = slab_sensor(size=4.0, friction=0.2, pixels=9)
    fine, coarse = box_mesh(sensor, 6, 6, 2), box_mesh(sensor, 4, 4, 2)
    settings = replace(EXACT, error_estimate=True)
    requests = [PressRequest(Sphere(1.5), x, -0.3, 0.0, (0.2, 0.4, 0.2)) for x in (0.2, -0.1)]

    def labels():
        model = SkinModel(sensor, settings, mesh=fine, companion=coarse)
        return [solution for _, solution in sorted(model.solve_many(requests, 2), key=lambda one: one[0])]

    plain = labels()
    as_on_a_gpu()
    for ours, theirs in zip(labels(), plain, strict=True):
        for name, share in (("surface", 1e-3), ("numerical", 0.02), ("traction", 0.02), ("force", 1e-3)):
            one, other = getattr(ours, name), getattr(theirs, name)
            assert np.abs(one - other).max() < share * np.abs(other).max(), name


@pytest.mark.long("tacdata/skin", reason="whole presses of protrusions, solved two ways")
def test_presses_on_protrusions_agree(as_on_a_gpu):
    sensor = bumps_sensor()
    mesh = build_mesh(sensor, MeshSettings(outer=0.9, interior=1.5, protrusion=1.0, tip=None))
    requests = [PressRequest(Sphere(2.0), x, 0.45, 0.0, (0.2, 0.4)) for x in (0.5, -0.3)]
    both_ways_agree(sensor, mesh, requests, as_on_a_gpu)
