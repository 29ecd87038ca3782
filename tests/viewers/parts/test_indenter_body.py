"""Where the drawn indenter stands."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tacdata.viewers.parts.skin_surface import indenter_body
from tacdata.viewers.parts.summary import of_press


@pytest.mark.parametrize("angles", [{}, {"tilt_x": 12.0}, {"yaw": 30.0, "tilt_x": -5.0, "tilt_y": 20.0}])
def test_the_lowest_point_of_the_drawn_shape_is_at_its_depth(episode, angles):
    press, tip = replace(episode.press, **angles), np.array([[0.5, -0.2, 0.8]])
    body = indenter_body(episode.sensor, press, np.zeros(1, dtype=np.int64), tip)
    drawn = Rotation.from_quat(body.quaternion).apply(body.vertices) + body.position[0]
    assert drawn[:, 2].min() == pytest.approx(episode.sensor.skin.thickness - 0.8, abs=2e-3)
    for name, angle in angles.items():
        assert f"{'yaw' if name == 'yaw' else 'about ' + name[-1]} {angle:g}°" in of_press(press)
