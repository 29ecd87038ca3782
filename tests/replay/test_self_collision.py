"""Links that run into each other are named, by the collision shapes of the URDF."""

import numpy as np

from tacdata.replay.self_collision import self_collisions

LINK = '<link name="{name}">{shape}</link>'
BAR = '<collision><origin xyz="0 0 0.1"/><geometry><box size="0.04 0.04 0.16"/></geometry></collision>'
JOINT = (
    '<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="0 0 0.2"/>'
    '<axis xyz="1 0 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
)


def arm(tmp_path, shape=BAR):
    """Three bars in a chain that folds."""
    links = "".join(LINK.format(name=name, shape=shape) for name in ("base", "upper", "lower"))
    joints = JOINT.format(name="a", parent="base", child="upper") + JOINT.format(
        name="b", parent="upper", child="lower"
    )
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="arm">{links}{joints}</robot>')
    return path


def test_a_folded_arm_runs_into_itself(tmp_path):
    values = np.array([[0.0, 0.0], [1.6, 0.0], [2.1, 2.1], [np.nan, 0.0]])
    found = self_collisions(arm(tmp_path), ("a", "b"), values, np.zeros(2))
    assert not found.reason and found.pairs == {("base", "lower"): (2,)}


def test_without_shapes_nothing_is_known(tmp_path):
    found = self_collisions(arm(tmp_path, ""), ("a", "b"), np.zeros((1, 2)), np.zeros(2))
    assert "fewer than two collision shapes" in found.reason and not found.pairs
