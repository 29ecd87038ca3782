"""Every shipped plan can be driven, and holds the presses that it was made for."""

from collections import Counter
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tacdata import registry
from tacdata.errors import UsageError
from tacdata.plans import Plan
from tacdata.plans.shipped.shipped_plan import BASE, ROOM, PlanOptions, shipped_plan
from tacdata.sensor import default_sensor

SENSOR = default_sensor()
NAMES = registry.names(ROOM, BASE)


def plan(name, sensor=SENSOR, **wishes):
    return Plan.from_document(shipped_plan(name, sensor, PlanOptions(**wishes)), name)


@pytest.mark.parametrize("name", NAMES)
def test_presses_lie_on_the_skin_and_mountings_come_once(name):
    found = plan(name)
    found.check_against(SENSOR)
    mountings = [(press.indenter_name, press.yaw) for press in found.presses]
    assert sum(a != b for a, b in pairwise(mountings)) == len(set(mountings)) - 1
    for press in found.presses:
        reach = press.indenter.footprint(press.deepest, press.yaw) if press.deepest > 0 else (0.0, 0.0)
        assert abs(press.x) + reach[0] < SENSOR.skin.size_x / 2, "the indenter stays off the frame"
        assert abs(press.y) + reach[1] < SENSOR.skin.size_y / 2
    assert shipped_plan(name, SENSOR) == shipped_plan(name, SENSOR)


def test_every_shipped_plan_is_among_them():
    assert set(NAMES) >= {"training", "evaluation", "diagnostic", "health"}
    with pytest.raises(UsageError, match="did you mean 'evaluation'"):
        shipped_plan("evalution", SENSOR)


def test_the_evaluation_has_the_papers_numbers_of_trials():
    presses = plan("evaluation").presses
    kinds = Counter(press.purpose for press in presses)
    assert kinds == {"depth trial": 78, "position trial": 40}
    depth = [press for press in presses if press.purpose == "depth trial"]
    assert len({press.depth for press in depth}) == 13
    assert len({(press.x, press.y) for press in depth}) == 6
    places = [(press.x, press.y) for press in presses if press.purpose == "position trial"]
    assert len(set(places)) == 40
    # The part of the sphere below 0.4 mm: at three places it reaches beyond the map, as at three of the paper's.
    radius = np.sqrt(2 * presses[0].indenter.document["radius"] * 0.4 - 0.4**2)
    edge = np.array([SENSOR.map.pixels_x, SENSOR.map.pixels_y]) * SENSOR.map.pixel_pitch / 2
    assert (np.abs(places) + radius > edge).any(axis=1).sum() == 3


def test_the_diagnostic_excites_what_each_effect_needs():
    presses = plan("diagnostic").presses
    speeds = {p.speed for p in presses if p.purpose == "rates"}
    assert max(speeds) / min(speeds) >= 10
    assert {p.approach_from for p in presses} >= {"+x", "-x", "+y", "-y"}
    assert any(p.overshoot > 0 for p in presses)
    assert any(p.hold >= 60 and p.recovery >= 60 and p.depth > 0.3 for p in presses)
    assert len({p.depth for p in presses if p.hold >= 60 and p.depth > 0}) >= 2
    assert len({p.indenter.document["radius"] for p in presses}) == 2
    assert {p.yaw for p in presses} == {0.0, 180.0}
    assert sum(-0.5 < p.depth < 0 for p in presses) >= 4, "fly-overs close to the skin"
    assert any(p.depth <= -2 and p.hold >= 60 for p in presses), "an idle stretch"
    assert len([p for p in presses if p.purpose == "reference"]) >= 4
    slow = {(p.x, p.y) for p in presses if p.purpose == "onset map"}
    assert len(slow) == 4


def test_the_virgin_site_is_virgin():
    presses = plan("diagnostic").presses
    first = next(p for p in presses if p.purpose == "virgin site")
    earlier = [p for p in presses[: first.index] if p.depth > 0]
    assert earlier
    for press in earlier:
        reach = press.indenter.footprint(press.depth, 0.0)[0] + first.indenter.footprint(first.depth, 0.0)[0]
        assert np.hypot(press.x - first.x, press.y - first.y) > reach


@pytest.mark.parametrize("name", NAMES)
def test_they_fit_other_sensors_too(name):
    small = replace(
        SENSOR,
        taxels=replace(SENSOR.taxels, columns=2, rows=2, pitch_x=4.0, pitch_y=4.0),
        skin=replace(SENSOR.skin, size_x=14.0, size_y=14.0, thickness=2.0),
    )
    plan(name, small).check_against(small)


def test_wishes_that_cannot_be_met_are_refused():
    with pytest.raises(UsageError, match="5 presses of the plan evaluation"):
        plan("evaluation", presses=5)
    with pytest.raises(UsageError, match="two of one shape"):
        plan("diagnostic", indenters=("sphere_2",))
    with pytest.raises(UsageError, match="hammer"):
        plan("evaluation", indenters=("hammer",))
