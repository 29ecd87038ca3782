"""The same presses on the CPU and on a GPU: one algorithm, other precision of the preconditioner.

Solved so tightly that they must find the same; what the default tolerance leaves is `test_skin_tolerance.py`'s.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from skin_examples import EXACT, HeldSlab, batch, box_mesh, bumps_sensor, slab_sensor

from tacdata.errors import SolveError
from tacdata.indenters.cylinder import Cylinder
from tacdata.indenters.flat_punch import FlatPunch
from tacdata.indenters.sphere import Sphere
from tacdata.sensor import Adhesion
from tacdata.skin.derivatives.press import sensitivities
from tacdata.skin.elasticity.body import Elasticity
from tacdata.skin.linear import constraint_kernels as kernels
from tacdata.skin.linear.constraint_solvers import InvertedCompliance
from tacdata.skin.linear.cuda_cg_columns import ActiveColumns
from tacdata.skin.linear.rest_stiffness import SparseRest, rest_solver
from tacdata.skin.member.conditions import conditions
from tacdata.skin.member.warp_arrays import argument, filled
from tacdata.skin.mesh.build import MeshSettings
from tacdata.skin.model import SkinModel
from tacdata.skin.press import PressRequest
from tacdata.warp_runtime import wp

pytestmark = [pytest.mark.gpu, pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")]
GPU = "cuda:0"


@pytest.fixture(scope="module")
def held():
    return HeldSlab()


def pair(sensor, settings=EXACT, mesh=None):
    """The same model on both devices."""
    there = SkinModel(sensor, settings, mesh=mesh)
    return there, SkinModel(sensor, settings, GPU, there.mesh)


def close(gpu, cpu):
    """Forces within 0.2 % of the largest, maps within 0.1 % of the depth, tractions within 2 % of the largest."""
    limit = EXACT.solver
    assert np.abs(gpu.force - cpu.force).max() < 2e-3 * np.abs(cpu.force).max()
    assert np.abs(gpu.surface - cpu.surface).max() < 1e-3 * cpu.depth.max()
    assert np.abs(gpu.traction - cpu.traction).max() < 0.02 * np.abs(cpu.traction).max()
    ours, theirs = (found.traction.sum(axis=(2, 3)) for found in (gpu, cpu))
    assert np.abs(ours - theirs).max() < 2e-3 * np.abs(theirs).max()
    assert gpu.residual.max() <= limit.residual
    assert np.all(gpu.penetration <= limit.penetration * np.maximum(gpu.depth, 0.1))


def test_presses_on_a_slab_agree():
    sensor = slab_sensor(size=4.0, friction=0.2, pixels=9)
    cpu, gpu = pair(sensor, mesh=box_mesh(sensor, 6, 6, 2))
    requests = [
        PressRequest(Sphere(1.5), 0.2, -0.3, 0.0, (0.2, 0.4, 0.2, 0.0)),
        PressRequest(Cylinder(1.2, 2.0, 0.5), 0.1, 0.0, 30.0, (0.3,)),
        PressRequest(FlatPunch(1.0, 0.9), -0.1, 0.2, 0.0, (0.3,)),
        PressRequest(Sphere(1.0), -0.4, 0.4, 0.0, (0.3,)),
    ]
    found = dict(gpu.solve_many(requests, 4))
    for number, request in enumerate(requests):
        close(found[number], cpu.solve(request))


def test_presses_on_protrusions_agree():
    settings = replace(EXACT, mesh=MeshSettings(outer=0.9, interior=1.5, protrusion=1.0, tip=None))
    cpu, gpu = pair(bumps_sensor(), settings)
    request = PressRequest(Sphere(2.0), 0.5, 0.45, 0.0, (0.2, 0.4, 0.2))
    ours, theirs = gpu.solve(request), cpu.solve(request)
    close(ours, theirs)
    assert np.abs(ours.taxel_force - theirs.taxel_force).max() < 2e-3 * theirs.taxel_force.max()


def test_a_press_that_diverges_leaves_its_neighbours_alone_on_a_card_too():
    sensor = slab_sensor(size=4.0, friction=0.2, pixels=9)
    cpu, gpu = pair(sensor, mesh=box_mesh(sensor, 6, 6, 2))
    good = PressRequest(FlatPunch(1.0, 0.9), 0.2, 0.1, 0.0, (0.15, 0.3))
    crushing = PressRequest(FlatPunch(1.5, 0.9), 0.0, 0.0, 0.0, (1.98,))
    found = dict(gpu.solve_many([crushing, good], 2))
    assert isinstance(found[0], SolveError) and "no equilibrium" in str(found[0])
    close(found[1], cpu.solve(good))


def test_a_skin_that_sticks_agrees():
    """Down onto it and drawn up again, beside a press elsewhere."""
    slab = slab_sensor(size=4.0, friction=0.2, pixels=9)
    sensor = replace(slab, contact=replace(slab.contact, adhesion=Adhesion("exponential", 5.0, 0.1)))
    cpu, gpu = pair(sensor, mesh=box_mesh(sensor, 6, 6, 2))
    requests = [PressRequest(Sphere(2.0), x, 0.0, 0.0, (0.0, 0.1, -0.05)) for x in (0.0, 0.4)]
    for request, (_, found) in zip(requests, sorted(gpu.solve_many(requests, 2), key=lambda one: one[0]), strict=True):
        ours = cpu.solve(request)
        assert ours.force[-1, 2] < 0.0, "drawn up, it pulls"
        close(found, ours)


def test_an_incompressible_skin_agrees():
    """Volume changes averaged at the corners; without friction, which remembers how steps were halved on the way."""
    slab = slab_sensor(size=4.0, friction=0.0, pixels=9)
    sensor = replace(slab, material=replace(slab.material, poisson_ratio=0.495))
    cpu, gpu = pair(sensor, mesh=box_mesh(sensor, 6, 6, 2))
    request = PressRequest(Sphere(1.5), 0.2, -0.3, 0.0, (0.2, 0.4))
    close(gpu.solve(request), cpu.solve(request))


def test_derivatives_agree():
    """Of a path with friction, and of one parameter asked for alone."""
    sensor = slab_sensor(size=4.0, friction=0.2, pixels=9)
    cpu, gpu = pair(sensor, mesh=box_mesh(sensor, 4, 4, 2))
    request = PressRequest(Sphere(1.5), 0.13, -0.21, 0.0, (0.1, 0.2, 0.15))
    for names in (["x", "z", "thickness", "friction", "poisson_ratio"], ["tilt_x"]):
        both = zip(sensitivities(gpu, request, names), sensitivities(cpu, request, names), strict=True)
        for (_, _, ours), (_, _, theirs) in both:
            for k in range(len(names)):
                assert np.abs(ours.force[k] - theirs.force[k]).max() < 0.01 * np.abs(theirs.force[k]).max() + 1e-6
                wide = np.abs(theirs.surface[k]).max()
                assert np.abs(ours.surface[k] - theirs.surface[k]).max() < 0.01 * wide + 1e-6


@pytest.mark.parametrize("averaged", [False, True])
def test_kernels_agree_to_rounding(held, averaged):
    u = 0.05 * np.sin(held.mesh.nodes @ np.random.default_rng(1).uniform(-1, 1, (3, 3)))
    p = np.random.default_rng(2).normal(size=u.shape)
    found = []
    for device in ("cpu", GPU):
        body = Elasticity(held.mesh, "neo_hookean", device, averaged)
        own = conditions(slab_sensor().material, 0.0, device=device).repeat(2)
        field, along = batch(u, 2 * u).to(device), batch(p, p).to(device)
        product = torch.zeros_like(field)
        body.tangent_product(field, along, own, product)
        found.append((body.internal_force(field, own)[0].cpu(), product.cpu(), body.energy(field, own).cpu()))
    for cpu, gpu in zip(*found, strict=True):
        assert (cpu - gpu).abs().max() < 1e-11 * cpu.abs().max()


def test_the_dense_inverse_is_a_good_preconditioner_and_its_compliance_is_its_own(held):
    """Half precision costs digits; that the compliance is read off the same rounded matrix costs none."""
    dense = rest_solver(held.mesh, slab_sensor().material, held.mesh.bottom, held.rows, GPU)
    sparse = SparseRest(held.stiffness, held.free, held.rows)
    r = held.random(2, 3)
    ours, theirs = dense.apply(r.to(GPU)).cpu(), sparse.apply(r)
    assert ((ours - theirs).norm(dim=0) < 2e-2 * theirs.norm(dim=0)).all()
    assert not ours[held.held].any()
    matrix = dense.table(torch.ones(0, dtype=torch.bool, device=GPU)).cpu()
    unit = torch.zeros(len(matrix), 1)
    unit[5] = 1.0
    moved = dense.rows(dense.apply(dense.spread(unit.to(GPU))))[:, 0].cpu()
    assert (matrix[5] - moved).abs().max() < 1e-3 * moved.abs().max()
    assert torch.equal(matrix, matrix.T)
    assert torch.linalg.eigvalsh(matrix.double()).min() > -1e-4


def compliance(device):
    """Of two members' constraints: nodes of three rows, as on a rough face; one of the last row, as on a flat one."""
    random = torch.Generator().manual_seed(6)
    table, size = torch.randn(31, 31, generator=random), 16
    first = torch.tensor([*[0] * 3, *[3] * 3, *[12] * 3, *[24] * 3, 30, 0, 0, 0]).repeat(2, 1).int()
    direction = torch.randn(2, size, 3, generator=random)
    direction[:, 12, 1:] = 0.0
    give, own = torch.rand(2, size, 2, generator=random), torch.tensor([13, 6]).int()
    room, scale = torch.zeros(2, size, size), torch.tensor([1.0, 2.0])
    member = torch.tensor([1, 0])
    values = (value.to(device) for value in (first, direction, give, own))
    rows = filled(kernels.RowData, **dict(zip(("first", "direction", "give", "own"), values, strict=True)))
    member, scale, table, room = (value.to(device) for value in (member, scale, table + table.T, room))
    wp.launch(
        kernels.assemble,
        dim=(2, -(-size // int(kernels.STRIP)), size),
        inputs=[argument(value) for value in (member, rows, scale, table, room)],
        device=device,
    )
    return room.cpu()


def test_compliances_agree_to_rounding():
    ours, theirs = compliance(GPU), compliance("cpu")
    assert theirs[0, 6:, 6:].equal(torch.eye(10)) and theirs[1, 12, :12].abs().min() > 0
    assert (ours - theirs).abs().max() < 1e-6 * theirs.abs().max()


def test_inverses_are_those_of_the_cpu_whatever_runs_beside_them():
    """Of several sizes, which a GPU works on side by side."""
    random, sizes = np.random.default_rng(4), [100, 300, 0, 500, 640, 128]
    matrices = [torch.as_tensor(root @ root.T / m + np.eye(m)) for m in sizes for root in [random.normal(size=(m, m))]]

    def assemble(member, room):
        room.copy_(torch.eye(room.shape[1]))
        for k, number in enumerate(member.tolist()):
            room[k, : sizes[number], : sizes[number]] = matrices[number]

    solver = InvertedCompliance()
    for _ in range(3):
        solver.update(sizes, range(len(sizes)), 768, assemble, torch.device(GPU))
        for number, (size, matrix) in enumerate(zip(sizes, matrices, strict=True)):
            found = solver.inverse[number, :size, :size].double().cpu()
            assert (found @ matrix - torch.eye(size)).norm() < 1e-4 * max(size, 1)


def test_a_recording_that_finds_the_card_full_leaves_it_usable():
    columns = SimpleNamespace(x=torch.zeros(1, device="cuda:0"))
    with pytest.raises(torch.OutOfMemoryError):
        ActiveColumns._record(columns, lambda _: torch.empty(2**42, device="cuda:0"))
    assert float(torch.ones(10, device="cuda:0").sum()) == 10.0
