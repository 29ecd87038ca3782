from itertools import pairwise

import numpy as np
import pytest
import yaml
from running.in_process import tacdata

from tacdata.errors import FormatError
from tacdata.plans import Plan, Press, read_plan
from tacdata.plans.recipe import write_out
from tacdata.recording.motion.plan_time import plan_time
from tacdata.recording.motion.press_steps import steps
from tacdata.rig import Registration
from tacdata.sensor import default_sensor

SENSOR = default_sensor()
MOTION = {"clearance": 3.0, "travel_speed": 20.0, "approach_speed": 5.0, "press_speed": 1.0, "hold": 0.5, "rest": 0.5}


def recipe(*blocks, **changes):
    return {
        "version": "1.0",
        "name": "mine",
        "indenters": {
            "ball": {"shape": "sphere", "radius": 2.0},
            "pin": {"shape": "flat_punch", "radius": 1.0, "edge_radius": 0.2},
        },
        "motion": MOTION,
        "blocks": list(blocks),
    } | changes


def written(*blocks, seed=0, **changes):
    return Plan.from_document(write_out(recipe(*blocks, **changes), SENSOR, "mine", seed), "mine").presses


def test_a_block_is_every_combination_once():
    block = {
        "indenter": "ball",
        "at": {"kind": "grid", "columns": 3, "rows": 2},
        "depths": [0.3, 0.6],
        "speeds": [0.2, 2.0],
        "holds": [0.5, 5.0],
        "repeats": 2,
    }
    presses = written(block)
    assert len(presses) == 6 * 2 * 2 * 2 * 2
    assert len({(p.x, p.y, p.depth, p.speed, p.hold, p.repeat) for p in presses}) == len(presses)
    assert [p.repeat for p in presses[:4]] == [0, 1, 0, 1], "repeats follow each other"
    shuffled = written({**block, "order": "random"}, seed=1)
    assert shuffled != presses
    assert {(p.x, p.y, p.depth) for p in shuffled} == {(p.x, p.y, p.depth) for p in presses}
    assert written({**block, "order": "random"}, seed=1) == shuffled


def test_leaning_mountings_are_plan_entries_that_stay_together():
    block = {"indenter": "pin", "tilts": [[0, 0], [5, -3]], "at": {"kind": "center"}, "depths": [0.3]}
    presses = written(block, {"indenter": "ball", "at": {"kind": "center"}, "depths": [0.3]}, {**block, "yaws": [90]})
    assert [p.mounting for p in presses] == [
        ("pin", 0.0, 0.0, 0.0),
        ("pin", 0.0, 5.0, -3.0),
        ("ball", 0.0, 0.0, 0.0),
        ("pin", 90.0, 0.0, 0.0),
        ("pin", 90.0, 5.0, -3.0),
    ]
    assert presses[1].turned == "0 deg, leaning 5 deg about x and -3 deg about y"
    assert presses[1].angles == {"yaw": 0.0, "tilt_x": 5.0, "tilt_y": -3.0} and presses[0].angles == {"yaw": 0.0}
    with pytest.raises(FormatError, match="tilts/0/1: 45 is greater than the maximum of 30"):
        written({**block, "tilts": [[0, 45]]})


@pytest.mark.parametrize(
    ("at", "count", "test"),
    [
        ({"kind": "taxels"}, 24, lambda p: _off_taxel(p) < 1e-9),
        ({"kind": "taxels", "only": [0, 5, 23]}, 3, lambda p: _off_taxel(p) < 1e-9),
        ({"kind": "between"}, 5 * 4 + 6 * 3 + 5 * 3, lambda p: _off_taxel(p) > 0.9),
        ({"kind": "between", "count": 7}, 7, lambda p: _off_taxel(p) > 0.9),
        ({"kind": "random", "count": 50}, 50, lambda p: abs(p.x) < 4.75 and abs(p.y) < 3.75),
        ({"kind": "edge", "count": 12, "beyond": 0.5}, 12, lambda p: abs(p.x) > 5.2 or abs(p.y) > 4.2),
        ({"kind": "center"}, 1, lambda p: p.x == p.y == 0),
    ],
    ids=lambda v: v.get("kind") if isinstance(v, dict) else None,
)
def test_sites_are_where_their_kind_says(at, count, test):
    presses = written({"indenter": "ball", "at": at, "depths": [0.3]})
    assert len({(p.x, p.y) for p in presses}) == count
    assert all(map(test, presses))


def _off_taxel(press):
    return np.linalg.norm(SENSOR.taxels.centers - [press.x, press.y], axis=1).min()


def test_presses_of_one_mounting_are_brought_together_unless_the_recipe_says_otherwise():
    blocks = [
        {"indenter": ["ball", "pin"], "yaws": [0, 90], "at": {"kind": "center"}, "depths": [0.3]},
        {"indenter": "ball", "at": {"kind": "center"}, "depths": [0.5]},
    ]
    order = [(p.indenter_name, p.yaw, p.depth) for p in written(*blocks)]
    assert order[:2] == [("ball", 0.0, 0.3), ("ball", 0.0, 0.5)]
    assert written(*blocks, grouped=False)[-1].depth == 0.5


@pytest.mark.parametrize(
    ("block", "word"),
    [
        ({"indenter": "ball", "at": {"kind": "points", "points": [[9.0, 0.0]]}, "depths": [0.3]}, "off the skin"),
        ({"indenter": "ball", "at": {"kind": "center"}, "depths": [3.5]}, "3.3 mm thick"),
        ({"indenter": "ball", "at": {"kind": "center"}, "depths": [3.0], "overshoot": 0.5}, "3.3 mm thick"),
        ({"indenter": "ball", "at": {"kind": "center"}, "depths": [-3.0]}, "no lower than the clearance"),
        ({"indenter": "thumb", "at": {"kind": "center"}, "depths": [0.3]}, "thumb"),
        ({"indenter": "ball", "at": {"kind": "center"}, "depths": [0.3], "speeds": [-1.0]}, "above 0 mm/s"),
        ({"indenter": "ball", "at": {"kind": "grid", "columns": 3}, "depths": [0.3]}, "columns, rows"),
        ({"indenter": "ball", "at": {"kind": "taxels", "only": [24]}, "depths": [0.3]}, "0 to 23"),
        ({"indenter": "ball", "at": {"kind": "spiral"}, "depths": [0.3]}, "spiral"),
    ],
)
def test_bad_blocks_end_in_words(block, word):
    with pytest.raises(FormatError) as caught:
        written(block)
    assert word in str(caught.value)


def test_sides_overshoot_and_recovery_are_driven():
    block = {
        "indenter": "ball",
        "at": {"kind": "center"},
        "depths": [0.5],
        "approach_from": ["-x"],
        "overshoot": 0.2,
        "recovery": 4.0,
        "rest": 3.0,
    }
    plan = Plan.from_document(write_out(recipe(block), SENSOR, "mine"), "mine")
    path = steps(plan.presses[0], plan.motion, Registration((0.0, 0.0, 0.0), 0.0))
    moves = [step.target for step in path if step.target]
    assert moves[0] == (-1.0, 0.0, 3.0), "beside the site first"
    assert moves[1] == (0.0, 0.0, 3.0)
    assert [round(z, 6) for _, _, z in moves[2:]] == [0.3, -0.7, -0.5, 0.3, 3.0]
    assert path[1].seconds == 3.0
    assert path[-1].seconds == 4.0
    assert plan_time(plan).seconds == pytest.approx(
        3.0 + 4.0 + 0.5 + (0.7 + 0.3) / 1.0 + 0.2 / 1.0 + (0.3 + 0.5) / 1.0 + 2 * 2.7 / 5.0 + 0.5, abs=1.2
    )


def test_strokes_are_driven_before_the_hold():
    """The guide goes to its depth, comes up and goes back twice, then holds; it stands where it turns."""
    block = {"indenter": "ball", "at": {"kind": "center"}, "depths": [0.5], "strokes": 2, "stroke": 0.2, "holds": [3.0]}
    plan = Plan.from_document(write_out(recipe(block), SENSOR, "mine"), "mine")
    press = plan.presses[0]
    path = steps(press, plan.motion, Registration((0.0, 0.0, 0.0), 0.0))
    moves = [round(step.target[2], 6) for step in path if step.target]
    assert moves[2:] == [-0.5, -0.3, -0.5, -0.3, -0.5, 0.3, 3.0]
    [hold] = [k for k, step in enumerate(path) if step.phase == "hold"]
    assert path[hold].seconds == 3.0 and path[hold - 1].target == path[hold - 5].target
    assert all((a.target is None) != (b.target is None) for a, b in pairwise(path)), "a pause after each move"
    assert "strokes" in press.document and Press.from_document(press.document).stroke == 0.2


def test_a_press_without_strokes_is_written_as_before():
    press = Plan.from_document(
        write_out(recipe({"indenter": "ball", "at": {"kind": "center"}, "depths": [0.5]}), SENSOR, "mine"), "mine"
    ).presses[0]
    assert not {"strokes", "stroke"} & press.document.keys()


def run(*arguments):
    done = tacdata("plan", *arguments)
    return done.returncode, done.stdout + done.stderr


def test_the_verb_writes_a_recipe_out_with_a_summary_and_a_picture(tmp_path):
    source = tmp_path / "recipe.yaml"
    block = {"indenter": ["ball", "pin"], "at": {"kind": "taxels"}, "depths": [0.3, 0.6], "purpose": "mine"}
    source.write_text(yaml.safe_dump(recipe(block)))
    code, said = run(source, "--out", tmp_path / "plan.yaml", "--picture", tmp_path / "plan.png")
    assert code == 0, said
    assert "96 presses at 24 sites" in said
    assert "2 mountings" in said
    assert len(read_plan(tmp_path / "plan.yaml").presses) == 96
    assert (tmp_path / "plan.png").read_bytes()[:4] == b"\x89PNG"
    code, said = run(tmp_path / "plan.yaml")
    assert code == 0
    assert "96 presses" in said
    for arguments, word in (
        ((source, "--out", tmp_path / "plan.yaml"), "exists"),
        ((tmp_path / "none.yaml", "--out", tmp_path / "new.yaml"), "no file"),
        ((source, "--presses", "4", "--out", tmp_path / "new.yaml"), "both are in the file"),
        (("training",), "nowhere to write"),
    ):
        code, said = run(*arguments)
        assert code == 2
        assert word in said


@pytest.mark.parametrize("depth", [-0.1, -0.3, -1.0, -2.9])
def test_a_fly_over_has_every_phase_as_a_move(depth):
    block = {"indenter": "ball", "at": {"kind": "center"}, "depths": [depth]}
    plan = Plan.from_document(write_out(recipe(block), SENSOR, "mine"), "mine")
    path = steps(plan.presses[0], plan.motion, Registration((0.0, 0.0, 0.0), 0.0))
    heights = [step.target[2] for step in path if step.target]
    assert min(heights) == pytest.approx(-depth)
    assert all(abs(a - b) > 0.01 for a, b in pairwise(heights))
