"""Every commanded position is checked against envelope and soft limits before anything moves."""

import numpy as np
import pytest
from recording_examples import LIMITS, SENSOR, plan, rig, rig_document

from tacdata.errors import FormatError
from tacdata.recording.motion.preflight import preflight
from tacdata.rig import rig as rig_file

TRAVEL = np.array([0.0, 0.0, -40.0]), np.array([200.0, 200.0, 0.0])


def test_within_both():
    summary = preflight(plan(2), SENSOR, rig(), LIMITS, (0, 1), TRAVEL, ("homing is off",))
    assert summary.presses == 2
    assert summary.text.endswith("caution: homing is off")
    assert summary.lower[2] == pytest.approx(-30.82)


def test_outside_the_soft_limits():
    travel = TRAVEL[0] + [0, 0, 10], TRAVEL[1]
    with pytest.raises(FormatError, match=r"(?s)presses/0 needs.*-30\.00\) to .*soft limits, \$130 to \$132"):
        preflight(plan(2), SENSOR, rig(), LIMITS, (0, 1), travel)


def test_outside_the_envelope():
    small = rig_document(envelope={"min": [0.0, 5.0, -33.0], "max": [10.0, 35.0, 0.0]})
    with pytest.raises(FormatError, match=r"(?s)presses/0 needs.*the rig's envelope"):
        preflight(plan(2), SENSOR, rig_file.from_document(small, "bench"), LIMITS, (0, 1), TRAVEL)
