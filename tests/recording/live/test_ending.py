"""The last lines: nothing that the error says is said again."""

from types import SimpleNamespace

import pytest

from tacdata.errors import DeviceError
from tacdata.recording.live.ending import ending

WHY = "the controller stopped with ALARM:7 (homing was interrupted by the safety door)"


@pytest.mark.parametrize(
    "line",
    [
        f"motion: the machine moved while homing, and {WHY}: its position is lost",
        f"motion: the machine moved while homing ({WHY}): its position is lost",
    ],
)
def test_the_errors_own_words_stand_once(line):
    error = DeviceError(WHY, "motion without an alarm", "home it")
    said = ending(SimpleNamespace(ending=(line,)), WHY, ("nothing was written",), "the same command", error)
    assert said.splitlines()[0].strip() == "motion: the machine moved while homing: its position is lost"
    assert WHY not in said
    assert "LOST" in said
