"""The small world as fixtures."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parent))
from training_frames import build_frames

from tacdata.training.frames.frames import Frames


@pytest.fixture(scope="session")
def frames() -> Frames:
    return build_frames()


@pytest.fixture
def other_sensor_frames() -> Frames:
    """The same frames said to be of a sensor with another thickness."""
    frames = build_frames()
    sensor = frames.sensor
    return replace(frames, sensor=replace(sensor, skin=replace(sensor.skin, thickness=3.0)))


@pytest.fixture
def make_frames():
    """The builder itself, for tests that want other sizes."""
    return build_frames
