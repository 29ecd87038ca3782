"""Standard deviations of a whole path: whose mesh, which branch, and what happens where derivatives are of no use."""

from dataclasses import replace

import numpy as np
import pytest
from skin_examples import box_mesh, slab_sensor

from tacdata.errors import SolveError, UsageError
from tacdata.indenters.sphere import Sphere
from tacdata.sensor import default_sensor
from tacdata.skin.derivatives import path_uncertainty
from tacdata.skin.derivatives.parameter_names import check_spreads
from tacdata.skin.derivatives.path_uncertainty import spreads_of, with_uncertainty
from tacdata.skin.derivatives.uncertainty import uncertainties
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest

SIZES = {"indenter/radius": 0.01, "indenter/length": 1.0}
SPREADS = {"x": 0.05, "z": 0.02, "youngs_modulus": 0.03, "friction": 0.05, **SIZES}
PRESS = PressRequest(Sphere(2.0), 0.13, -0.21, 0.0, (0.0, 0.15, 0.4, 0.25, 0.0))


@pytest.fixture(scope="module")
def skin():
    sensor = replace(slab_sensor(size=4.0, pixels=9), uncertainty=SPREADS)
    settings = ModelSettings(error_estimate=False, step=0.45)
    return SkinModel(sensor, settings, mesh=box_mesh(sensor, 8, 8, 2), companion=box_mesh(sensor, 6, 6, 2))


@pytest.fixture(scope="module")
def solved(skin):
    return skin.solve(PRESS)


@pytest.fixture(scope="module")
def known(skin, solved):
    return with_uncertainty(skin, PRESS, solved)


def test_a_press_takes_the_spreads_that_it_has(skin):
    assert set(spreads_of(skin.sensor, PRESS.indenter)) == {"x", "z", "youngs_modulus", "indenter/radius"}
    rough = replace(skin.sensor, contact=replace(skin.sensor.contact, friction=0.2), uncertainty={**SPREADS, "z": 0.0})
    assert set(spreads_of(rough, PRESS.indenter)) == {"x", "youngs_modulus", "friction", "indenter/radius"}
    check_spreads(skin.sensor, PRESS.indenter)
    with pytest.raises(UsageError, match="uncertainty of glue") as refusal:
        check_spreads(replace(rough, uncertainty={"glue": 0.1}), PRESS.indenter)
    assert "thickness" in refusal.value.allowed


def test_all_states_get_the_companions_loading_branch(skin, solved, known):
    assert np.array_equal(known.surface, solved.surface)
    spreads = spreads_of(skin.sensor, PRESS.indenter)
    first, second = (u for _, _, u in uncertainties(skin.companion, replace(PRESS, depths=(0.15, 0.4)), spreads))
    # Its linear solves are less exact than those of `uncertainties`, by what spreads can bear.
    share = 0.03
    assert known.uncertainty[1] == pytest.approx(first.surface, abs=share * first.surface.max())
    assert known.uncertainty[2] == pytest.approx(second.surface, abs=share * second.surface.max())
    between = 0.6 * first.force + 0.4 * second.force
    assert known.force_uncertainty[3] == pytest.approx(between, abs=share * between.max())
    assert not known.uncertainty[0].any() and not known.uncertainty[-1].any() and not known.force_uncertainty[-1].any()
    assert 0.018 < known.uncertainty[2].max() < 0.04, "under the tip at least the spread of the height"
    said = known.provenance["uncertainty"]
    assert said["mesh"] == skin.companion.mesh.content_hash and said["method"] == "first_order"
    assert said["spreads"] == spreads and said["units"]["youngs_modulus"] == "MPa"


def test_states_that_the_companion_solved_before_are_not_solved_again(skin, solved, known, monkeypatch):
    apart = known
    meshes = {"mesh": skin.mesh, "companion": skin.companion.mesh}
    asking = SkinModel(skin.sensor, replace(skin.settings, error_estimate=True), **meshes)
    beside = replace(PRESS, x=0.4, depths=(0.0, 0.2, 0.0))
    coarse = asking.solve_coarsely([beside, PRESS], 2)[1]
    assert [len(passage.reached) for passage in coarse.passages] == [2, 1], "the touch, then each state"
    monkeypatch.setattr(asking.companion.skin, "batch", None)
    shared = with_uncertainty(asking, PRESS, solved, coarse)
    assert shared.uncertainty == pytest.approx(apart.uncertainty, abs=0.01 * apart.uncertainty.max())
    assert shared.force_uncertainty == pytest.approx(apart.force_uncertainty, rel=0.01, abs=1e-6)
    assert shared.provenance["uncertainty"] == apart.provenance["uncertainty"]
    monkeypatch.undo()
    broken = replace(coarse, passages=coarse.passages[:1])
    again = with_uncertainty(asking, PRESS, solved, broken)
    assert again.uncertainty == pytest.approx(apart.uncertainty, rel=1e-3), "half a path is solved anew"
    silent = SkinModel(replace(skin.sensor, uncertainty={}), asking.settings, **meshes)
    assert silent.solve_coarsely([PRESS])[0].passages == ()


def test_the_companions_spread_is_nearly_the_meshs_own(skin, known):
    [(_, _, own)] = uncertainties(skin, replace(PRESS, depths=(0.4,)), spreads_of(skin.sensor, PRESS.indenter))
    difference = np.sqrt(((known.uncertainty[2] - own.surface) ** 2).mean() / (own.surface**2).mean())
    assert 0 < difference < 0.25
    assert known.force_uncertainty[2, 2] == pytest.approx(own.force[2], rel=0.1)


def test_without_spreads_or_contact_nothing_is_said(skin, solved):
    blank = replace(solved)
    silent = SkinModel(replace(skin.sensor, uncertainty={}), skin.settings, mesh=skin.mesh)
    assert with_uncertainty(silent, PRESS, blank).uncertainty is None
    apart = with_uncertainty(skin, replace(PRESS, depths=(0.0,)), blank)
    assert apart.uncertainty is None and apart.provenance["uncertainty"]["remark"] == "no contact"


def test_derivatives_steeper_than_the_shape_give_way_to_whole_presses(skin, solved, known, monkeypatch):
    monkeypatch.setattr(path_uncertainty, "_STEEPER", 0.5)
    drawn = with_uncertainty(skin, PRESS, solved)
    monkeypatch.undo()
    said = drawn.provenance["uncertainty"]
    assert said["method"] == "sampled" and said["remark"].count("mm a mm of") == 2
    assert said["mesh"] == skin.companion.mesh.content_hash
    assert drawn.force_uncertainty[2, 2] == pytest.approx(known.force_uncertainty[2, 2], rel=0.6)
    assert drawn.uncertainty[2].mean() == pytest.approx(known.uncertainty[2].mean(), rel=0.6)


def test_what_is_not_found_is_said_and_the_path_kept(skin, solved, monkeypatch):
    def fails(*_, **__):
        raise SolveError("the linear solve stalls", "a residual", "none")

    monkeypatch.setattr(path_uncertainty, "sensitivities", fails)
    monkeypatch.setattr(path_uncertainty, "sampled_spread", fails)
    kept = with_uncertainty(skin, PRESS, solved)
    assert kept.uncertainty is None and np.array_equal(kept.surface, solved.surface)
    assert kept.provenance["uncertainty"]["remark"].count("the linear solve stalls") == 3


@pytest.mark.long("tacdata/skin", reason="both meshes of the default skin")
@pytest.mark.timeout(900)
def test_on_the_default_skin_mesh_and_branch_matter_little():
    """As the module's docstring says: `pytest --long=all -s -k matter_little` prints them."""
    skin = SkinModel(default_sensor())
    press = PressRequest(Sphere(3.0), 1.1, -0.7, 0.0, (0.25, 0.5, 0.25))
    spreads = spreads_of(skin.sensor, press.indenter)
    # By the linear solves that paths get.
    coarse, fine = (path_uncertainty._first_order(model, press, spreads) for model in (skin.companion, skin))

    def differ(one, other):
        return np.sqrt(((one.surface - other.surface) ** 2).mean() / (other.surface**2).mean())

    meshes = [differ(a, b) for (_, a), (_, b) in zip(coarse, fine, strict=True)]
    forces = [a.force[2] / b.force[2] - 1 for (_, a), (_, b) in zip(coarse, fine, strict=True)]
    branch = differ(coarse[0][1], coarse[2][1])
    print(f"\nmeshes {np.round(meshes, 3)}, forces {np.round(forces, 3)}, branch {branch:.3f}")
    assert max(meshes) < 0.25 and np.abs(forces).max() < 0.1 and branch < 0.1
