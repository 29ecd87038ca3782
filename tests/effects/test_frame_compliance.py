"""A frame gives way by what it says where the force is largest, and in balance with the force everywhere."""

from types import SimpleNamespace

import numpy as np
import pytest

from tacdata.chain import State
from tacdata.effects import load


def force(pose, tool):
    return 1.3 * np.maximum(pose[:, 2], 0.0) ** 1.5


@pytest.mark.parametrize("name", ["frame_compliance", "carriage_compliance"])
@pytest.mark.parametrize("deflection", [0.05, 0.3, 0.573])
def test_deflection_is_what_was_asked_and_in_balance(name, deflection):
    depth = np.linspace(-0.2, 1.5, 60)
    pose = np.column_stack([0 * depth, 0 * depth, depth])
    course, response = SimpleNamespace(tool=np.zeros(60, int)), SimpleNamespace(force=force)
    state = State(course, response, pose, np.empty((60, 0)), np.empty(0), np.empty((60, 0)))
    after = load(name).apply(state, {"c": np.array(deflection)}).pose
    given = depth - after[:, 2]
    assert given.max() == pytest.approx(deflection, rel=1e-9)
    reached = force(after, None)
    assert given == pytest.approx(deflection * reached / reached.max(), abs=0.003 * deflection)
    assert np.all(given[depth <= 0] == 0)
