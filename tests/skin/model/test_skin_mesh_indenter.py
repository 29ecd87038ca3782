"""A press with a solid from a file, against the same press with the closed form that was tessellated."""

import numpy as np
import pytest
import trimesh
from skin_examples import box_mesh, slab_sensor

from tacdata.indenters import from_document
from tacdata.indenters.flat_punch import FlatPunch
from tacdata.indenters.sphere import Sphere
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest

DEPTHS = (0.25, 0.5)


def ball():
    """Facets of 0.3 mm, up to 9 um below the sphere."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=2.0)
    mesh.apply_translation([0, 0, 2.0])
    return mesh


def punch():
    """A fillet of 0.8 mm: a sharper one has several equilibria on elements of 0.75 mm."""
    angle = np.linspace(0, np.pi / 2, 9)
    line = np.stack([1.2 + 0.8 * np.sin(angle), 0.8 * (1 - np.cos(angle))], axis=-1)
    return trimesh.creation.revolve(np.array([[0, 0], *line, [2.0, 8.0], [0, 8.0]]), sections=64)


@pytest.fixture(scope="module")
def model():
    settings = ModelSettings(error_estimate=False)
    return SkinModel(slab_sensor(), settings, mesh=box_mesh(slab_sensor(), 8, 8, 4))


FACETS = pytest.mark.long("tacdata/skin", "tacdata/indenters", reason="whole presses of a ball of facets")


@pytest.mark.parametrize(
    ("make", "exact"), [pytest.param(ball, Sphere(2.0), marks=FACETS), (punch, FlatPunch(2.0, 0.8))]
)
def test_forces_and_maps_are_those_of_the_closed_form(model, tmp_path, make, exact):
    make().export(tmp_path / "shape.stl")
    found = from_document({"shape": "mesh", "file": "shape.stl"}, "case", tmp_path)
    ours, theirs = (
        model.solve(PressRequest(indenter=indenter, x=0.1, y=0.05, yaw=0.0, depths=DEPTHS))
        for indenter in (found, exact)
    )
    assert ours.force[:, 2] == pytest.approx(theirs.force[:, 2], rel=5e-3)
    assert np.abs(ours.surface - theirs.surface).max() < 3e-3
