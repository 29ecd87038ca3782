"""Indenters whose tips do not sit where the registered one's sat."""

from dataclasses import replace

import numpy as np
import pytest
from device_doubles import Board, Controller
from recording_examples import LIMITS, SENSOR, rig, rig_document

from tacdata.clock import Clock
from tacdata.errors import FormatError, UsageError
from tacdata.plans import Plan
from tacdata.plans.recipe import write_out
from tacdata.recording.files.reader import read_recording
from tacdata.recording.live.rig_devices import RigDevices
from tacdata.recording.motion.preflight import preflight
from tacdata.recording.recorder import Recorder
from tacdata.rig import registration_for

OFFSET = (0.4, -0.3, -2.0)  # 2 mm longer than the registered one
TOOLS = {"long": {"offset": list(OFFSET), "method": "touched a gauge block"}}
MOTION = {"clearance": 3.0, "travel_speed": 20.0, "approach_speed": 5.0, "press_speed": 2.0, "hold": 0.2, "rest": 0.2}


@pytest.fixture
def plan():
    recipe = {
        "version": "1.0",
        "name": "two tools",
        "motion": MOTION,
        "indenters": {"ball": {"shape": "sphere", "radius": 2.0}, "long": {"shape": "sphere", "radius": 2.0}},
        "blocks": [{"indenter": ["ball", "long"], "at": {"kind": "points", "points": [[1, 0.5]]}, "depths": [0.4]}],
    }
    return Plan.from_document(write_out(recipe, SENSOR, "two"), "two")


def test_a_longer_tool_is_driven_higher_and_its_tip_recorded_where_it_is(plan, tmp_path):
    clock = Clock.start(10.0)
    cnc, heights = Controller(clock), []
    board = Board(clock, cnc)

    def mount(press):
        heights.append((press.indenter_name, cnc.position()[2]))
        board.surface = rig(tools=TOOLS).registration_for(press.indenter_name).origin[2]

    recorder = Recorder(
        replace(rig(tools=TOOLS), clock=clock),
        SENSOR,
        plan,
        tmp_path / "session",
        devices=RigDevices(cnc, board),
        mount=mount,
    )
    session = recorder.run(lambda summary: True)
    # Both are mounted where the longer one clears the skin, at -30 mm, by 3 mm.
    assert [name for name, _ in heights] == ["ball", "long"]
    assert all(height >= -25.0 - 1e-6 for _, height in heights)
    moves = np.array([call[1] for call in cnc.calls if call[0] == "move"])
    short, long = (read_recording(path) for path in session.episodes)
    for recording in (short, long):
        assert recording.episode.tip[:, 2].max() == pytest.approx(0.4, abs=1e-6)
        deepest = recording.episode.tip[recording.episode.tip[:, 2].argmax()]
        np.testing.assert_allclose(deepest, [1.0, 0.5, 0.4], atol=1e-6)
    apart = long.moves[-2].command.start - short.moves[-2].command.start
    np.testing.assert_allclose(apart, -np.array(OFFSET), atol=1e-5)
    assert moves[:, 2].max() == pytest.approx(-25.0)
    with pytest.raises(UsageError, match="tool offsets"):
        Recorder(
            rig(), SENSOR, plan, tmp_path / "session", resume=True, devices=RigDevices(cnc, Board(clock, cnc))
        ).run(lambda _: True)


def test_the_summary_names_offsets_and_those_that_are_missing(plan):
    bench = rig(tools=TOOLS)
    summary = preflight(plan, SENSOR, bench, LIMITS, (0, 1))
    assert "tool offsets [mm]: long (0.40, -0.30, -2.00)" in summary.text
    assert "no tool offset for ball" in summary.text
    assert "tool offset" not in preflight(plan, SENSOR, rig(), LIMITS, (0, 1)).text
    assert summary.upper[2] == pytest.approx(-25.0)
    assert registration_for(bench.document, "ball") == bench.registration


def test_an_offset_that_leaves_the_envelope_is_refused(plan):
    far = rig(tools={"long": {"offset": [0.0, 0.0, -40.0]}})
    with pytest.raises(FormatError, match="envelope"):
        preflight(plan, SENSOR, far, LIMITS, (0, 1))
    with pytest.raises(FormatError, match="offset"):
        rig(tools={"long": {"offset": [0.0, "deep", 1.0]}})
    assert "tools" not in rig_document()
