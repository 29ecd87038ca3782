"""`tacdata solve`: what its files hold, what it refuses."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from skin_examples import bumps_sensor, slab_sensor
from typer.testing import CliRunner

from tacdata import cli, documents
from tacdata.cases.case import read_case
from tacdata.cases.mesh import mesh_for
from tacdata.errors import FormatError, UsageError
from tacdata.indenters.flat_punch import FlatPunch
from tacdata.indenters.ring import Ring
from tacdata.indenters.sphere import Sphere
from tacdata.skin.mesh.generation.background import edge_length
from tacdata.skin.press import PressRequest

MESH = {"outer": 0.6, "interior": 1.0, "protrusion": 0.8}
CASE = {
    "version": "1.1",
    "name": "small",
    "sensor": {**bumps_sensor().document, "version": "1.1"},
    "indenter": {"shape": "sphere", "radius": 2.0},
    "x": 0.4,
    "y": 0.3,
    "depths": [0.0, 0.3],
    "mesh": MESH,
}


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """The example, solved with everything that can be asked for: its folder and document."""
    folder = tmp_path_factory.mktemp("case")
    (folder / "case.yaml").write_text(yaml.safe_dump(CASE))
    arguments = ["solve", str(folder / "case.yaml"), "--out", str(folder / "out"), "--picture"]
    shown = CliRunner().invoke(cli.application(), arguments)
    assert shown.exit_code == 0, shown.output
    return folder / "out", documents.read(folder / "out" / "small.json", "case_result")


def test_every_state_says_forces_areas_readings_and_errors(solved):
    _, document = solved
    rest, pressed = document["results"]
    assert pressed["force_N"][2] > 0.05 and max(pressed["protrusion_contact_area_mm2"]) > 0.02
    assert np.argmax(pressed["protrusion_force_N"]) == np.argmax(pressed["readings"]["counts"]) == 3
    described = bumps_sensor().transduction
    assert described is not None
    offset = np.ravel(described.offset)
    assert rest["readings"]["counts"] == pytest.approx(np.broadcast_to(offset, 4))
    error = pressed["numerical_error"]
    assert 0 < error["force_N"] < 0.3 * pressed["force_N"][2]
    assert 0 < error["map_rms_mm"] <= error["map_max_mm"] < 0.3
    assert rest["numerical_error"]["map_max_mm"] == 0
    assert document["error_seconds"] > 0 and len(error["protrusion_force_N"]) == 4


def test_the_table_has_a_row_for_every_node_of_the_face_and_state(solved):
    folder, document = solved
    table = pq.read_table(folder / document["displacements"]).to_pandas()
    assert list(table.columns) == ["case", "depth", "x", "y", "ux", "uy", "uz"]
    deep = table[table.depth == 0.3]
    assert len(deep) == len(table) / 2 and not table[table.depth == 0.0][["ux", "uy", "uz"]].any(axis=None)
    nearest = deep.iloc[np.hypot(deep.x - 0.4, deep.y - 0.3).argmin()]
    assert nearest.uz == pytest.approx(-0.3, abs=0.06)


def test_the_picture_is_drawn(solved):
    folder, document = solved
    assert (folder / document["picture"]).read_bytes().startswith(b"\x89PNG")
    assert not list(folder.glob(".*"))


def test_results_are_not_overwritten(solved):
    folder, _ = solved
    before = (folder / "small.json").read_bytes()
    shown = CliRunner().invoke(cli.application(), ["solve", str(folder.parent / "case.yaml"), "--out", str(folder)])
    assert isinstance(shown.exception, UsageError) and "never overwritten" in shown.exception.allowed
    assert (folder / "small.json").read_bytes() == before


def test_the_estimate_is_on_unless_the_case_says_no(tmp_path):
    for given, wanted in (({}, True), ({"error_estimate": False}, False), ({"version": "1.0"}, True)):
        (tmp_path / "case.json").write_text(json.dumps({**CASE, **given}))
        assert read_case(tmp_path / "case.json").error_estimate is wanted
    (tmp_path / "case.json").write_text(json.dumps({**CASE, "error_estimate": "yes"}))
    with pytest.raises(FormatError, match="error_estimate"):
        read_case(tmp_path / "case.json")


def test_under_a_punch_the_mesh_is_fine_at_its_edge_alone():
    slab = slab_sensor(size=10.0)
    wide, round_one, hollow = FlatPunch(2.0, 0.3), Sphere(4.0), Ring(2.0, 0.5)
    of = {shape: mesh_for(slab, PressRequest(shape, 1.0, 0.0, 0.0, (0.5,))) for shape in (wide, round_one, hollow)}
    focus = of[wide].focus
    assert focus and len(focus) == 5 and focus[4] == pytest.approx(1.7 - 0.4, abs=0.02)
    assert all(len(of[shape].focus or ()) == 4 for shape in (round_one, hollow))
    points = np.array([[1.0, 0.0, 2.0], [2.8, 0.0, 2.0], [5.0, 0.0, 2.0]])
    middle, edge, away = edge_length(slab.skin, of[wide], points, np.zeros(3))
    assert edge == focus[3] and middle > 3 * edge and away > 3 * edge
