"""What an emulated hand is set up for, before its devices are switched on."""

import pytest

from tacdata.errors import UsageError
from tacdata.virtual_rig.demo import SILENT_AFTER, VirtualDemo


@pytest.fixture
def demo_of(tmp_path):
    """Set up hands that are switched off at the end."""
    made = []

    def build(**options):
        made.append(VirtualDemo(tmp_path / str(len(made)), **options))
        return made[-1]

    yield build
    for demo in made:
        demo.stop()


def test_a_finger_that_falls_silent_leaves_time_to_type_the_next_command(demo_of, monkeypatch):
    demo = demo_of(speed=0.5, fault="silent-finger")
    assert SILENT_AFTER >= 60 and any(f"{SILENT_AFTER:g} s of its clock" in line for line in demo.emulates)
    reader = demo._reader("middle", 2)
    closed = []
    monkeypatch.setattr(demo.boards["middle"].port, "close", lambda: closed.append(True))
    reader(demo.start_ns + int((SILENT_AFTER - 1) * 1e9))
    assert not closed
    reader(demo.start_ns + int((SILENT_AFTER + 1) * 1e9))
    assert closed


def test_objects_belong_to_their_task(tmp_path, demo_of):
    assert demo_of(thing="can").hand.thing == "can"
    assert demo_of(task="wipe").hand.thing == "eraser"
    for task, thing in (("wipe", "can"), ("grasp", "eraser"), ("grasp", "pear")):
        with pytest.raises(UsageError, match="ball, can, box"):
            VirtualDemo(tmp_path, task=task, thing=thing)
