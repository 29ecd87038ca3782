from itertools import pairwise

import numpy as np
import pytest
from typer.testing import CliRunner

from tacdata.cli import application
from tacdata.errors import UsageError
from tacdata.plans import Plan, read_plan
from tacdata.plans.shipped.training import DEPTHS, USUAL, training_plan
from tacdata.plans.specimens import STANDARD
from tacdata.sensor import default_sensor

SENSOR = default_sensor()


def test_same_seed_same_plan():
    assert training_plan(SENSOR, 24, 3) == training_plan(SENSOR, 24, 3)
    assert training_plan(SENSOR, 24, 3) != training_plan(SENSOR, 24, 4)


@pytest.mark.parametrize("presses", [1, 24, 97])
def test_presses_lie_on_the_skin_and_are_spread(presses):
    plan = Plan.from_document(training_plan(SENSOR, presses, 1), "plan")
    plan.check_against(SENSOR)
    assert len(plan.presses) == presses
    depths = np.sort([press.depth for press in plan.presses])
    assert DEPTHS[0] <= depths[0] <= depths[-1] <= DEPTHS[1]
    if presses > 1:
        assert np.diff(depths).max() < 2.1 * (DEPTHS[1] - DEPTHS[0]) / presses
    if presses > 20:
        assert {press.indenter_name for press in plan.presses} == set(USUAL)
        on_taxel = [np.abs(SENSOR.taxels.centers - [p.x, p.y]).max(axis=1).min() < 1e-3 for p in plan.presses]
        assert 0.2 < np.mean(on_taxel) < 0.5


def test_each_mounting_comes_once():
    entries = training_plan(SENSOR, 60, 0, tuple(STANDARD))["presses"]
    mountings = [(entry["indenter"], entry["yaw"]) for entry in entries]
    changes = sum(a != b for a, b in pairwise(mountings))
    assert changes == len(set(mountings)) - 1
    assert len(set(mountings)) > len(STANDARD)


def test_unknown_indenters_are_refused():
    with pytest.raises(UsageError, match="banana"):
        training_plan(SENSOR, 5, 0, ("banana",))


def test_the_verb_writes_a_plan_and_never_over_another(tmp_path):
    path = tmp_path / "plan.yaml"
    arguments = ["plan", "--presses", "6", "--seed", "2", "--out", str(path), "--indenter", "sphere_2"]
    assert CliRunner().invoke(application(), arguments).exit_code == 0
    plan = read_plan(path)
    assert len(plan.presses) == 6
    assert {p.indenter_name for p in plan.presses} == {"sphere_2"}
    with pytest.raises(UsageError, match="exists"):
        CliRunner().invoke(application(), arguments, catch_exceptions=False)
