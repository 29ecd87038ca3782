"""The lower face of a leaning indenter, against closed forms."""

import numpy as np

from tacdata.indenters import from_document
from tacdata.virtual_rig import mount
from tacdata.virtual_rig.world.lower_face import FAR, LowerFace
from tacdata.virtual_rig.world.mounting import Mounted

BALL = {"shape": "sphere", "radius": 2.0}
PIN = {"shape": "cylinder", "radius": 1.0, "length": 6.0, "edge_radius": 0.2}


def test_a_leaning_ball_is_the_ball_beside_its_origin():
    face = LowerFace.of(from_document(BALL), 15.0, 20.0, 0.0)
    # Leaning by 20 deg about x carries the ball's centre, 2 mm above the origin, along -y.
    shift = 2 * np.sin(np.radians(20.0))
    x, y = np.meshgrid(np.linspace(-1, 1, 21), np.linspace(-1, 1, 21))
    np.testing.assert_allclose(face.profile(x, y - shift), 2 - np.sqrt(4 - x**2 - y**2), atol=0.02)


def test_a_leaning_pin_touches_with_one_end():
    face = LowerFace.of(from_document(PIN), 0.0, 0.0, 10.0)
    line = np.linspace(-2.5, 2.5, 11)
    height = face.profile(line, np.zeros(11))
    # Its axis falls along +x by the sine of the tilt; a positive turn about y takes x downward.
    np.testing.assert_allclose(np.diff(height), -0.5 * np.tan(np.radians(10.0)), atol=2e-3)
    assert abs(face.heights.min()) < 0.01 and (face.profile(np.array([9.0]), np.zeros(1)) == FAR).all()


def test_what_leans_is_mounted_as_it_leans(tmp_path):
    mounted = Mounted(tmp_path / "mounted.json")
    mount(tmp_path, PIN, 90.0, 0.0, 10.0)
    mounted.look()
    along_x, along_y = (mounted.indenter.profile(np.array(p[0]), np.array(p[1])) for p in ((2.0, 0.0), (0.0, 2.0)))
    assert mounted.yaw == 0.0 and along_x == FAR and along_y < 1.0, "the yaw turns the pin along y, then it leans"
    mount(tmp_path, PIN, 90.0)
    mounted.look()
    assert mounted.yaw == 90.0 and mounted.indenter.document["shape"] == "cylinder"
