"""A plan with several mountings, broken off and taken up again."""

import threading
from dataclasses import replace

import pytest
from device_doubles import Board, Controller
from recording_examples import SENSOR, rig

from tacdata.clock import Clock
from tacdata.errors import DeviceError
from tacdata.plans import Plan
from tacdata.plans.recipe import write_out
from tacdata.recording.files import file_names
from tacdata.recording.live.rig_devices import RigDevices
from tacdata.recording.recorder import Recorder

MOTION = {"clearance": 3.0, "travel_speed": 20.0, "approach_speed": 5.0, "press_speed": 2.0, "hold": 0.2, "rest": 0.2}


@pytest.fixture
def plan():
    recipe = {
        "version": "1.0",
        "name": "three mountings",
        "motion": MOTION,
        "indenters": {"ball": {"shape": "sphere", "radius": 2.0}, "big": {"shape": "sphere", "radius": 4.0}},
        "blocks": [
            {"indenter": ["ball", "big"], "at": {"kind": "points", "points": [[0, 0], [2, 1]]}, "depths": [0.4]},
            {"indenter": "big", "yaws": [180], "at": {"kind": "center"}, "depths": [0.4]},
        ],
    }
    return Plan.from_document(write_out(recipe, SENSOR, "three"), "three")


def test_only_what_is_missing_is_done_with_the_indenter_that_it_needs(plan, tmp_path):
    mounted, clock = [], Clock.start(10.0)
    cnc = Controller(clock)
    board = Board(clock, cnc)

    def recorder(resume, progress=None):
        return Recorder(
            replace(rig(), clock=clock),
            SENSOR,
            plan,
            tmp_path / "session",
            resume=resume,
            devices=RigDevices(cnc, board),
            mount=lambda press: mounted.append((press.indenter_name, press.yaw)),
            progress=progress,
        )

    def cut_the_cable(done, wanted, seconds):
        if done == 3:
            fault = DeviceError("the line to the taxel board broke", "a port", "check the cable")
            threading.Timer(0.05, lambda: setattr(board, "broken", fault)).start()

    with pytest.raises(DeviceError, match="line to the taxel board"):
        recorder(False, cut_the_cable).run(lambda summary: True)
    assert mounted == [("ball", 0.0), ("big", 0.0)]
    done = set(file_names.finished(tmp_path / "session"))
    assert {0, 1, 2} <= done < {0, 1, 2, 3, 4}

    board.broken, shown = None, []
    session = recorder(True).run(lambda summary: shown.append(summary) or True)
    missing = [press for press in plan.presses if press.index not in done]
    wanted = list(dict.fromkeys((press.indenter_name, press.yaw) for press in missing))
    assert mounted[2:] == wanted, "asked for again, as nobody knows what sits there by now"
    assert shown[0].presses == len(missing)
    assert session.remaining == ()
    assert len(session.episodes) == 5
