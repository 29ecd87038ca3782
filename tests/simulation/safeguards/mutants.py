"""Safeguards that can be taken out one at a time: what must hold has to notice that each is missing."""

import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest import mock

from tacdata.devices.grbl import Grbl
from tacdata.recording import recorder
from tacdata.recording.live import guarded_motion, rig_streams
from tacdata.recording.live.camera_stream import CameraStream
from tacdata.recording.live.guarded_motion import GuardedMotion
from tacdata.recording.live.lost_position import PositionGuard
from tacdata.recording.live.machine_state import MachineState
from tacdata.recording.motion.allowed_path import AllowedPath
from tacdata.wire.grbl import link as grbl_link
from tacdata.wire.grbl import owed, silence, watch


def _without_state(*names):
    """Judge reports without some unasked states or fields."""
    plain = watch.what_is_wrong

    def judged(report, *arguments, **options):
        changes = {"pendant": False} if "pendant" in names else {}
        changes |= {"feed_override": None} if "override" in names else {}
        report = replace(report, **changes)
        if report.state.split(":")[0] in names:
            return None, False
        return plain(report, *arguments, **options)

    return mock.patch.object(grbl_link, "what_is_wrong", judged)


def _deeper(press, motion, registration):
    return _STEPS(replace(press, depth=press.depth + 0.3), motion, registration)


_STEPS = recorder.steps

MUTANTS = {
    "never lifts after a fault": lambda: mock.patch.object(
        GuardedMotion, "lift", lambda self, height, speed: setattr(self, "_lifted", "the indenter was not lifted")
    ),
    "lifts once, and believes it": lambda: mock.patch.object(guarded_motion, "LIFTS", 1),
    "no question about a lost position": lambda: mock.patch.object(PositionGuard, "doubt", lambda self, resumed: ""),
    "a session forgets what another lost": lambda: mock.patch.multiple(
        MachineState, why_lost="", loss="", difference="", is_known=True
    ),
    "no watch of the path": lambda: mock.patch.object(AllowedPath, "off", lambda self, status: None),
    "an owed answer is waited for": lambda: mock.patch.object(owed.Watch, "ending", lambda self, last, late=0.0: None),
    "every press 0.3 mm too deep": lambda: mock.patch.object(recorder, "steps", _deeper),
    "no watch of stalls": lambda: mock.patch.object(guarded_motion, "_look_again", lambda looked, now: now),
    "an override is ignored": lambda: _without_state("override"),
    "a pendant is ignored": lambda: _without_state("pendant"),
    "a foreign hold is ignored": lambda: _without_state("Hold"),
    "an open door is ignored": lambda: _without_state("Door"),
    "an alarm keeps the position": lambda: mock.patch.object(Grbl, "position_lost", ""),
    "bad readings are ignored": lambda: mock.patch.object(
        rig_streams.ReadingHealth, "take", lambda self, arrival_ns, counts: ""
    ),
    "a motion leaves no mark": lambda: mock.patch.object(MachineState, "moving", lambda self: None),
    "no touch before the first press": lambda: mock.patch.object(
        recorder.Recorder, "_touch_first", lambda self, prove, press, position, streams: position
    ),
    "what waits unread is silence": lambda: mock.patch.object(silence, "bytes_waiting", lambda line: 0),
    "a camera may repeat one image": lambda: mock.patch.object(CameraStream, "is_new", lambda self, frame: True),
}
"""Safeguard that is missing -> a context in which it is."""


KINDS = {
    "never lifts after a fault": ("board_unplugged",),
    "lifts once, and believes it": ("damaged_lift",),
    "no question about a lost position": ("killed",),
    "a session forgets what another lost": ("brown_out",),
    "no watch of the path": ("damaged_press",),
    "an owed answer is waited for": ("lost_answer",),
    "every press 0.3 mm too deep": ("damaged_frame",),
    "no watch of stalls": ("computer_stalls",),
    "an override is ignored": ("foreign_override",),
    "a pendant is ignored": ("pendant",),
    "a foreign hold is ignored": ("foreign_hold",),
    "an open door is ignored": ("door",),
    "an alarm keeps the position": ("alarm",),
    "bad readings are ignored": ("board_freezes", "board_saturates"),
    "a motion leaves no mark": ("killed",),
    "no touch before the first press": ("board_unplugged",),
    "what waits unread is silence": ("reader_starves",),
    "a camera may repeat one image": ("camera_freezes",),
}
"""Missing safeguard -> kinds of faults that show it soonest."""


@contextmanager
def without(name):
    """A context in which a safeguard is missing."""
    with MUTANTS[name]():
        yield


def noticed(name, seeds, kinds=()):
    """The first seed in which something does not hold without a safeguard; None if there is none."""
    from simulated_run import play

    with without(name):
        return next((seed for seed in seeds if play(seed, kinds)[1]), None)


def main(seeds):
    """Print the seed that notices each missing safeguard among seeds of any fault; return how many none notices."""
    unnoticed = 0
    for name in MUTANTS:
        begin = time.process_time()
        seed = noticed(name, range(seeds))
        unnoticed += seed is None
        found = "noticed by none" if seed is None else f"noticed by seed {seed}"
        print(f"{name}: {found}, {time.process_time() - begin:.0f} s of a core", flush=True)
    return unnoticed


if __name__ == "__main__":
    simulation = Path(__file__).parents[1]
    sys.path += [str(simulation), str(simulation.parent)]  # pyserial imports the lines by the folder's name
    sys.exit(bool(main(int(sys.argv[1]))))
