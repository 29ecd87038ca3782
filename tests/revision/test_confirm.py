"""A revised model is held against presses solved anew, where it moves the loads most."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "surrogate"))
from test_surrogate_table import BALL, SENSOR, FastModel, made

from tacdata.chain import Course, Tool
from tacdata.effects import Placed, load
from tacdata.revision.labels import confirm as room
from tacdata.revision.labels.confirm import confirm
from tacdata.skin.mesh.build import MeshSettings
from tacdata.surrogate.grid import Reach
from tacdata.surrogate.press_store import PressStore
from tacdata.surrogate.shipped import Shipped

REACH = Reach(BALL, 0.0, (-2.0, -1.0), (2.0, 1.0), 1.0)


@pytest.fixture
def held(tmp_path, monkeypatch):
    """Presses at three places, held against a table of the fast model."""
    table, _ = made(tmp_path, FastModel(), REACH, left_out=0).done()
    rows = [(e, x, y, d) for e, (x, y) in enumerate(((0.0, 0.0), (1.0, 0.5), (-1.7, 0.9))) for d in (0.0, 0.4, 0.8)]
    number, x, y, d = map(np.array, zip(*rows, strict=True))
    course = Course(
        time=np.arange(len(rows), dtype=float),
        episode=number,
        tip=np.column_stack([x, y, d]),
        tool=np.zeros(len(rows), dtype=int),
        readings=np.zeros((len(rows), 24)),
        averaged=np.ones(len(rows)),
        session=np.zeros(3, dtype=int),
        site=np.arange(3),
        tools=(Tool("ball", "sphere", 2.0),),
        names=("a", "b", "c"),
    )
    monkeypatch.setattr(room, "SkinModel", lambda *_: FastModel())
    store = SimpleNamespace(of=lambda model: PressStore(model, tmp_path / "confirmed", Shipped(tmp_path / "none")))
    monkeypatch.setattr(room, "PressStore", store)
    return SimpleNamespace(course=course, setting=SimpleNamespace(response=table.response, given=()))


def placed(name, **values):
    return [Placed(load(name), {k: np.array(v) for k, v in values.items()})]


def test_a_deeper_tip_is_solved_where_it_is_now(held):
    found = confirm(held, placed("z_offset", dz=0.1), SENSOR, {"ball": REACH}, 2, MeshSettings())
    assert len(found) == 2 and found[0].place != found[1].place
    assert all(c.solved and c.depth == pytest.approx(0.9) and c.change > 0.05 for c in found)
    assert all(c.difference < 0.01 for c in found), "the table says what the model says"


def test_a_readout_effect_needs_no_finite_elements(held):
    assert confirm(held, placed("latency", L=0.1), SENSOR, {"ball": REACH}, 2, MeshSettings()) == []


def test_an_effect_that_only_stands_in_for_the_skin_is_found_out(held):
    """The fast model knows nothing of thickness: the factor of the effect is off by what it claims."""
    found = confirm(held, placed("thickness", e=0.2), SENSOR, {"ball": REACH}, 1, MeshSettings())
    assert found[0].most > 0.15
