"""A camera that repeats one image with fresh time stamps, and images of a take that was broken off."""

import numpy as np
import pytest
from simulated_rig import CLEARANCE, ORIGIN, World
from simulated_run import Run

from tacdata.errors import DeviceError
from tacdata.recording.files.reader import read_recording

FROZEN = 8.0
"""Time at which the camera begins to repeat its image [s]; the first press is under way."""


@pytest.fixture
def world(tmp_path):
    made = World(3, tmp_path / "session", camera=True)
    yield made
    made.end()


def test_a_camera_that_repeats_one_image_is_silent_and_the_words_state_it(world):
    world.schedule.at(round(FROZEN * 1e9), lambda: setattr(world.camera, "frozen_at", 7))
    with pytest.raises(DeviceError, match="camera side: the same image again and again for 3 s"):
        world.record()
    assert world.stops[0] - FROZEN < 3.5
    assert world.position()[2] == pytest.approx(ORIGIN[2] + CLEARANCE, abs=0.01)


def test_a_camera_that_never_changed_is_no_fault(world):
    """Images of a drawn scene, or of a covered lens, may all be equal."""
    world.camera.frozen_at = 7
    assert len(world.record().done) == 2


def test_no_image_or_frame_of_a_broken_take_is_in_the_next(world):
    world.schedule.at(round(FROZEN * 1e9), lambda: world.controller.inject_byte(0x21))
    broken = Run(world)
    assert "someone held the motion" in str(broken.error)
    took_until = world.clock.now_ns()
    world.reboot()
    session = world.record(resume=True)
    for path in session.episodes:
        recording = read_recording(path)
        view = recording.cameras["side"]
        first = min(view.arrival_ns[0], recording.episode.taxels.arrival_ns[0])
        assert first > took_until, path.name
        assert np.all(np.diff(view.sequence) == 1)
        assert np.all(np.diff(recording.episode.taxels.counter) == 1)
