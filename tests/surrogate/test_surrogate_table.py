"""Tables of presses: where they are solved, how they are mirrored and continued, what they say in between."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tacdata.chain.table_response import TableResponse
from tacdata.errors import SolveError, UsageError
from tacdata.indenters import from_document
from tacdata.labels import PathSolution
from tacdata.sensor import default_sensor
from tacdata.skin.mesh.build import MeshSettings
from tacdata.skin.model import ModelSettings
from tacdata.surrogate.build import LEAST_ERROR, TableSettings, Work, work
from tacdata.surrogate.grid import UNIT, Reach, covering
from tacdata.surrogate.press_store import PressStore
from tacdata.surrogate.reading import reading_of
from tacdata.surrogate.shipped import Shipped
from tacdata.surrogate.spec import written_spec
from tacdata.surrogate.symmetry import foldable, mirrored, round_about_axis
from tacdata.transduction import Loads, Transducer

SENSOR = default_sensor()
BALL = from_document({"shape": "sphere", "radius": 2.0}, "test")
PRISM = from_document({"shape": "prism", "angle": 120.0, "edge_radius": 0.5, "length": 5.0, "width": 4.0}, "test")


def load_at(x, y, depth):
    """Return a made-up load of every taxel [N], shape (..., 24): smooth in place, Hertzian in depth."""
    centers = SENSOR.taxels.centers
    away = np.square(centers[:, 0] - np.asarray(x)[..., None]) + np.square(centers[:, 1] - np.asarray(y)[..., None])
    return 0.2 * np.asarray(depth)[..., None] ** 1.5 * np.exp(-away / (2 * 1.8**2))


class FastModel:
    """Stands in for the skin model; cannot go deeper than it is told, and counts what it was asked."""

    def __init__(self, deepest=np.inf):
        self.sensor, self.settings = SENSOR, ModelSettings(mesh=MeshSettings(outer=9.0))
        self.mesh, self.content_hash = SimpleNamespace(nodes=np.zeros((100, 3))), "f" * 64
        self.identity = {"code": "fast"}
        self.deepest, self.asked = deepest, 0

    def solve_many(self, requests, capacity=1):
        for k, r in enumerate(requests):
            self.asked += 1
            if max(r.depths) > self.deepest:
                yield k, SolveError("no equilibrium", "one", "reduce the depth")
                continue
            depth = np.array(r.depths)
            force = load_at(r.x, r.y, depth)
            normal = np.zeros((len(depth), 3))
            normal[:, 2] = 2.0 * force.sum(axis=1)
            none = np.zeros((len(depth), 1, 1))
            nil = np.zeros(len(depth))
            yield (
                k,
                PathSolution(
                    depth=depth,
                    surface=none,
                    numerical=none,
                    taxel_force=force,
                    taxel_force_error=force,
                    taxel_closure=0.5 * force,
                    taxel_area=0.1 * force,
                    force=normal,
                    force_error=nil,
                    residual=nil,
                    penetration=nil,
                    provenance={},
                ),
            )


def made(tmp_path, model, reach, spacing=0.8, left_out=6):
    settings = TableSettings(spacing=spacing, left_out=left_out)
    store = PressStore(model, tmp_path / "presses", Shipped(tmp_path / "nothing"))
    return Work(SENSOR, settings, model, store, covering([reach], SENSOR, spacing), ("ball",), (reach,))


def test_a_sensor_with_two_planes_of_symmetry_is_pressed_on_a_quarter():
    assert foldable(SENSOR, BALL, 0.0) and round_about_axis(BALL)
    assert foldable(SENSOR, PRISM, 0.0) and foldable(SENSOR, PRISM, 90.0)
    assert not foldable(SENSOR, PRISM, 30.0) and not round_about_axis(PRISM)
    left = load_at(-1.3, 0.4, 1.0)
    np.testing.assert_allclose(mirrored(left, SENSOR, True, False), load_at(1.3, 0.4, 1.0), atol=1e-15)
    np.testing.assert_allclose(mirrored(left, SENSOR, False, True), load_at(-1.3, -0.4, 1.0), atol=1e-15)
    whole = covering([Reach(BALL, 0.0, (-3.0, -2.0), (3.0, 2.0), 1.0)], SENSOR, 0.8)
    corner = covering([Reach(BALL, 0.0, (2.0, 1.0), (3.0, 2.0), 1.0)], SENSOR, 0.8)
    assert whole.folded and len(whole.presses(Reach(BALL, 0.0, (-3.0, -2.0), (3.0, 2.0), 1.0))) == 5 * 4
    # Places are those of every other session, so that presses are shared.
    assert set(np.round(corner.x, 6)) <= set(np.round(0.8 * np.arange(-20, 20), 6))


def test_a_table_says_between_its_nodes_what_the_model_says_there(tmp_path):
    reach = Reach(BALL, 0.0, (-3.0, -2.0), (3.0, 2.0), 1.2)
    table, off = made(tmp_path, FastModel(), reach).done()
    assert off and off.presses == 6
    assert off.load < 0.003 and off.worst < 0.02
    assert table.error == table.response.error == max(off.share, LEAST_ERROR) and 0 < off.share < 0.02
    rng = np.random.default_rng(1)
    pose = np.column_stack([rng.uniform(-3, 3, 200), rng.uniform(-2, 2, 200), rng.uniform(0.05, 1.2, 200)])
    said = table.response.load(pose, np.zeros(200, dtype=int))
    true = load_at(*pose.T)
    assert np.abs(said - true).max() < 0.01 * true.max()
    _, worse = made(tmp_path, FastModel(), reach, spacing=3.0).done()
    assert worse and worse.load > 3 * off.load, "a wide table must be told to be worse"
    assert table.uncovered((("ball", np.array([2.9, -1.9]), 1.2),)) == []
    assert len(table.uncovered((("ball", np.array([6.9, 0.0]), 1.2), ("ball", np.array([0.0, 0.0]), 3.2)))) == 2


class StiffeningModel(FastModel):
    """Loads that grow by a higher power the deeper the press, as those of a bonded layer do."""

    def solve_many(self, requests, capacity=1):
        for k, answer in super().solve_many(requests, capacity):
            factor = 1 + 2 * np.asarray(answer.depth)[:, None] ** 2
            yield k, replace(answer, taxel_force=answer.taxel_force * factor)


def test_a_table_as_deep_as_the_presses_says_what_a_deeper_one_says(tmp_path):
    deep, shallow = (
        made(tmp_path / str(d), StiffeningModel(), Reach(BALL, 0.0, (-2.0, -1.0), (2.0, 1.0), d), left_out=0).done()[0]
        for d in (1.9, 1.2)
    )
    depth = np.linspace(0.1, 1.2, 40)
    pose = np.column_stack([np.full(40, 0.3), np.full(40, -0.4), depth])
    none = np.zeros(40, dtype=int)
    true = load_at(*pose.T) * (1 + 2 * depth**2)[:, None]
    largest = np.abs(true).max(axis=1)
    for table, most in ((deep, 0.01), (shallow, 0.01)):
        off = np.abs(table.response.load(pose, none) - true).max(axis=1) / largest
        assert off[depth > 0.5].max() < most
    apart = np.abs(shallow.response.load(pose, none) - deep.response.load(pose, none)).max(axis=1) / largest
    assert apart.max() < 5e-4, "what lies beyond the presses must not bend the spline through them"


def test_presses_are_kept_and_a_press_without_equilibrium_ends_earlier(tmp_path):
    reach = Reach(BALL, 0.0, (-1.0, -1.0), (1.0, 1.0), 1.0)
    model = FastModel(deepest=0.8)
    first, _ = made(tmp_path, model, reach, left_out=0).done()
    asked = model.asked
    assert not first.solved[0, :, :, -3].any() and first.solved[0, 4, 4, 5], "0.75 mm was solved, 1.08 mm was not"
    pose = np.array([[0.0, 0.0, 0.75], [0.0, 0.0, 1.0]])
    said = first.response.load(pose, np.zeros(2, dtype=int))
    assert said[0].max() < said[1].max(), "beyond, loads go on rising"
    again, _ = made(tmp_path, model, reach, left_out=0).done()
    assert model.asked == asked, "nothing is solved twice, also what ended early"
    np.testing.assert_array_equal(again.load, first.load)
    damaged = next((tmp_path / "presses").glob("*.npz"))
    damaged.write_bytes(b"no archive")
    assert len(made(tmp_path, model, reach, left_out=0).missing) == 1


def test_readings_follow_the_sensor_files_transduction(tmp_path):
    force = load_at(0.3, -0.2, np.linspace(0, 1.2, 7))
    reading = reading_of(SENSOR, Loads(force, 0.5 * force, 0.1 * force))
    assert reading.by == "force"
    table, off = made(tmp_path, FastModel(), Reach(BALL, 0.0, (-1.0, -1.0), (1.0, 1.0), 1.0), left_out=0).done()
    assert off is None
    said = table.response.signal(force)
    true = Transducer.of(SENSOR).read(Loads(force, 0.5 * force, 0.1 * force)).counts
    np.testing.assert_allclose(said, true, atol=2e-3 * np.ptp(true))


def test_a_table_is_written_once_and_read_as_a_response(tmp_path):
    ready = made(tmp_path, FastModel(), Reach(BALL, 0.0, (-1.0, -1.0), (1.0, 1.0), 1.0), left_out=0)
    table, off = ready.done()
    written_spec(tmp_path / "base", ready, table, off)
    response = TableResponse.read(tmp_path / "base" / "response.npz")
    pose = np.array([[0.2, 0.1, 0.9]])
    np.testing.assert_allclose(response.load(pose, np.zeros(1, dtype=int))[0], load_at(*pose[0]), atol=2e-3)
    with pytest.raises(UsageError, match="exists"):
        written_spec(tmp_path / "base", ready, table, off)


def test_presses_of_the_default_sensor_ship_so_that_its_table_costs_nothing():
    reaches = {"sphere_4": Reach(from_document({"shape": "sphere", "radius": 4.0}, "t"), 0.0, (-3, -2), (3, 2), 1.0)}
    ready = work(SENSOR, reaches)
    assert ready.missing == [] and ready.expected_seconds == 0
    table, _ = ready.done()
    pose = np.array([[0.95, 1.25, d] for d in (0.2, 0.5, 1.0)])
    force = table.response.force(pose, np.zeros(3, dtype=int))
    # Hertz at small depth, stiffer by the bonded layer: between the two exponents.
    power = np.diff(np.log(force)) / np.diff(np.log(pose[:, 2]))
    assert np.all((power > 1.3) & (power < 2.3))
    loads = table.response.load(pose, np.zeros(3, dtype=int))
    assert np.all(np.argmax(loads, axis=1) == np.argmin(np.square(SENSOR.taxels.centers - pose[0, :2]).sum(axis=1)))
    assert np.all(loads.sum(axis=1) < force), "the rim carries the rest"


@pytest.mark.long("tacdata/skin", "tacdata/surrogate", reason="a press of the default skin on its own mesh")
def test_a_shipped_press_is_what_the_model_of_today_says():
    from tacdata.skin.model import SkinModel
    from tacdata.skin.press import PressRequest

    depths = tuple(round(UNIT * k**2, 6) for k in range(9))
    asked = PressRequest(from_document({"shape": "sphere", "radius": 4.0}, "t"), 0.8, 0.8, 0.0, depths)
    kept = Shipped.of(SENSOR, MeshSettings()).get(asked)
    assert kept is not None
    # Straight to the deepest: what is asked in between is solved for its own sake.
    now = SkinModel(SENSOR, ModelSettings(error_estimate=False)).solve(replace(asked, depths=depths[::8]))
    assert kept.normal[-1] == pytest.approx(now.force[-1, 2], rel=0.02)
    assert np.abs(kept.loads.force[-1] - now.taxel_force[-1]).max() < 0.02 * now.taxel_force[-1].max()
