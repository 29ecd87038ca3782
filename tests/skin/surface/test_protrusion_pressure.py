"""From pressures at nodes to a map of each protrusion: what it bears is on its own map, wherever it has moved."""

import numpy as np
import pytest

from tacdata.indenters.sphere import Sphere
from tacdata.sensor.protrusion_pixels import PIXELS, ProtrusionPixels
from tacdata.skin.press import PressRequest


@pytest.fixture(scope="module")
def pixels(bumps):
    return ProtrusionPixels(bumps.sensor.skin.protrusion_radius)


def tips(mesh):
    """Which nodes of the protrusions lie low, and their places; the third protrusion's alone."""
    nodes = np.unique(mesh.protrusions)
    own = np.isin(nodes, mesh.protrusions[mesh.protrusion_taxel == 2])
    places = mesh.nodes[nodes]
    return own & (places[:, 2] < -0.5), places


def test_each_protrusion_has_its_load_on_its_own_map(bumps, pixels):
    """Pixels times their area sum to the load that the solver states; the most loaded one is pressed in its middle."""
    solution = bumps.solve(PressRequest(Sphere(2.0), 0.5, 0.45, 0.0, (0.0, 0.3, 0.6, 0.3)))
    assert solution.taxel_pressure is not None
    load = pixels.pitch**2 * solution.taxel_pressure.sum(axis=(2, 3))
    # Two quadrature rules of the same curved faces.
    assert load == pytest.approx(solution.taxel_force, rel=1e-3, abs=1e-9)
    assert solution.taxel_force[2].max() > 0.04 and not solution.taxel_pressure[0].any()
    most = solution.taxel_pressure[2, solution.taxel_force[2].argmax()]
    assert most[3:7, 3:7].mean() > 3 * most.mean() and not most[[0, -1]].any() and not most[:, [0, -1]].any()
    peak, mean = most.max(), solution.taxel_force[2].max() / solution.taxel_area[2].max()
    assert mean < peak < 3 * mean


def test_a_load_lies_where_the_protrusion_has_moved_to(bumps, pixels):
    low, _ = tips(bumps.mesh)
    pressure, u = np.where(low, 0.1, 0.0), np.zeros_like(bumps.mesh.nodes)
    still = bumps.skin.protrusions.pressure(u, pressure)
    u[:, :2] = [0.2, -0.1]
    moved = bumps.skin.protrusions.pressure(u, pressure)
    assert [own.any() for own in still] == [own.any() for own in moved] == [False, False, True, False]
    assert moved.sum() == pytest.approx(still.sum(), rel=1e-12)
    for axis, shift in ((0, 0.2), (1, -0.1)):
        middle = [(own[2].sum(axis=1 - axis) * pixels.offsets).sum() / own[2].sum() for own in (still, moved)]
        assert middle[1] - middle[0] == pytest.approx(shift, abs=0.005)


def test_what_lies_off_the_pixels_counts_at_their_border(bumps):
    low, _ = tips(bumps.mesh)
    u = np.zeros_like(bumps.mesh.nodes)
    here = bumps.skin.protrusions.pressure(u, low.astype(float))
    u[:, 0] = 5.0
    away = bumps.skin.protrusions.pressure(u, low.astype(float))
    assert away.shape == (4, PIXELS, PIXELS)
    assert away[2, -1].sum() == pytest.approx(here.sum(), rel=1e-12) == away.sum()


def test_without_a_board_there_is_no_such_map(slab):
    assert slab.solve(PressRequest(Sphere(2.0), 0.0, 0.0, 0.0, (0.2,))).taxel_pressure is None
