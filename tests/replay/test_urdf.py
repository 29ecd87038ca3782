"""URDFs as CAD programs write them: what cannot be meant is refused with its figure, what is missing is said."""

import numpy as np
import pytest

from tacdata.errors import FormatError
from tacdata.replay.robot.urdf import read_urdf

PLAIN = '<limit lower="-1" upper="1" effort="1" velocity="0.5"/>'


def joint(name, kind, parent, child, limit=PLAIN, axis="1 0 0", more=""):
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}<axis xyz="{axis}"/>{limit}{more}</joint>'


def read(tmp_path, *joints, links=("base", "a", "tip")):
    path = tmp_path / "robot.urdf"
    path.write_text('<robot name="r">' + "".join(f'<link name="{n}"/>' for n in links) + "".join(joints) + "</robot>")
    return read_urdf(path)


def pair(first="", second="", **changes):
    """Two joints, the second a slide; what changes is the first."""
    given = {"name": "turn", "kind": "revolute", "parent": "base", "child": "a", **changes}
    return joint(**given, more=first), joint("slide", "prismatic", "a", "tip", more=second)


def limit(lower, upper, velocity=1):
    return f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="{velocity}"/>'


REFUSED = {
    "degrees": (pair(limit=limit(-180, 180)), r"turn: a limit of 180 rad: are these degrees\?"),
    "millimetres": (pair(kind="prismatic", limit=limit(0, 300)), r"a limit of 300 m: are these millimetres\?"),
    "far": (pair('<origin xyz="0 0 300"/>'), r"stands 300 m from the one before"),
    "turned": (pair('<origin rpy="0 90 0"/>'), r"turned by 90 rad: are these degrees\?"),
    "backwards": (pair(limit=limit(1, -1)), "lower 1 above upper -1 rad"),
    "no number": (pair(limit=limit("nan", 1)), "lower 'nan'"),
    "empty": (pair(limit=limit(-1, "")), "upper ''"),
    "negative speed": (pair(limit=limit(-1, 1, -2)), "a largest speed of -2 rad/s"),
    "no axis": (pair(axis="0 0 0"), "an axis of length 0"),
    "commas": (pair(axis="1, 0, 0"), "xyz '1, 0, 0' of its axis"),
    "planar": (pair(kind="planar"), "of type 'planar'"),
    "floating": (pair(kind="floating"), "of type 'floating'"),
    "capital": (pair(kind="Revolute"), "of type 'Revolute'"),
    "twice": (pair(name="slide"), "joint slide stands there twice"),
    "two limits": (pair(limit(-2, 2)), "joint turn has limit twice"),
    "two origins": (pair('<origin xyz="0 0 1"/><origin xyz="0 0 2"/>'), "joint turn has origin twice"),
    "nowhere": (pair(parent="moon"), "parent link 'moon'"),
    "leader": (pair("", '<mimic joint="thumb"/>'), "slide mimics 'thumb'"),
    "itself": (pair("", '<mimic joint="slide"/>'), "slide mimics itself"),
    "circle": (pair('<mimic joint="slide"/>', '<mimic joint="turn"/>'), "turn mimics itself by way of slide"),
    "twofold": (pair("", '<mimic joint="turn" multiplier="twice"/>'), "multiplier 'twice'"),
    "macro": (pair(limit=limit("${-reach}", "${reach}")), "a xacro whose macros are not expanded"),
    "loop": ((*pair(), joint("back", "fixed", "tip", "base")), "every link hangs on another"),
    "two ways": ((*pair(), joint("also", "fixed", "base", "tip")), "link tip hangs on two joints"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_meant_is_refused_with_its_figure(tmp_path, case):
    joints, words = REFUSED[case]
    with pytest.raises(FormatError, match=words):
        read(tmp_path, *joints)


def test_a_link_that_hangs_on_nothing_is_refused(tmp_path):
    with pytest.raises(FormatError, match="links base, alone hang on no joint"):
        read(tmp_path, *pair(), links=("base", "a", "tip", "alone"))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("", "joint turn: the URDF gives no limits of the position"),
        (limit("-inf", "inf"), "joint turn: the URDF gives no limits of the position"),
        (limit(0, 0), "joint turn: cannot move, as both limits are 0 rad"),
        ('<limit lower="-1" effort="1" velocity="1"/>', "joint turn: the URDF gives no upper limit, so it is 0 rad"),
        (limit(-1, 1, 180), "joint turn: a largest speed of 180 rad/s is more than robots do (degrees or a stand-in?)"),
    ],
)
def test_what_is_missing_or_odd_is_said(tmp_path, given, said):
    (words,) = read(tmp_path, *pair(limit=given)).remarks
    assert words.startswith(said)


def test_one_sentence_names_all_joints_of_a_kind(tmp_path):
    bare = joint("slide", "prismatic", "a", "tip", limit="")
    (words,) = read(tmp_path, pair(limit="")[0], bare).remarks
    assert words.startswith("joint turn, slide: the URDF gives no limits")


@pytest.mark.parametrize(("speed", "known"), [("0.5", 0.5), ("0", None), ("inf", None), ("1e3", 1000.0)])
def test_a_speed_of_nought_or_infinity_is_none(tmp_path, speed, known):
    found = read(tmp_path, *pair(limit=limit(-1, 1, speed)))
    assert found.velocity.get("turn") == known and found.velocity["slide"] == 0.5


def test_a_prefix_that_is_not_declared_is_passed_over(tmp_path):
    """As in a published file of an arm: the program that knows the prefix reads it so."""
    from tacdata.replay.kinematics import Kinematics
    from tacdata.replay.robot import read_robot

    given = PLAIN.replace("<limit", '<limit drake:acceleration="2.5"')
    assert read(tmp_path, *pair(limit=given)).velocity["turn"] == 0.5
    (tmp_path / "robot.yaml").write_text('{version: "1.0", name: r, urdf: robot.urdf, fingers: {index: {link: tip}}}')
    assert Kinematics(read_robot(tmp_path / "robot.yaml"), ("index",)).joints[0].upper == 1.0


def test_a_limit_on_one_side_only_can_be_drawn_from(tmp_path):
    from tacdata.replay.kinematic_search import KinematicSearch
    from tacdata.replay.kinematics import Kinematics
    from tacdata.replay.robot import read_robot

    read(tmp_path, *pair(limit=limit("-inf", 0.5)))
    (tmp_path / "robot.yaml").write_text('{version: "1.0", name: r, urdf: robot.urdf, fingers: {index: {link: tip}}}')
    model = Kinematics(read_robot(tmp_path / "robot.yaml"), ("index",))
    assert model.joints[0].upper == 0.5
    drawn = np.array([KinematicSearch(model).drawn(np.random.default_rng(k)) for k in range(5)])
    assert np.isfinite(drawn).all() and drawn[:, 0].max() <= 0.5


@pytest.mark.parametrize("encoding", ["latin-1", "shift_jis", "utf-32"])
def test_an_encoding_that_is_not_named_is_the_reason(tmp_path, encoding):
    path = tmp_path / "robot.urdf"
    name = "\u95a2" if encoding == "shift_jis" else "\u00fc"
    path.write_bytes(f'<robot name="{name}"><link name="base"/></robot>'.encode(encoding))
    with pytest.raises(FormatError, match="not in the encoding") as caught:
        read_urdf(path)
    assert "save it as UTF-8" in caught.value.remedy
