"""A robot's URDF without shapes and masses, checked against the format and a robot's possibilities.

MuJoCo takes much in silence. A joint whose limits are missing or exchanged turns freely; degrees count as
radians; a mimic joint without its leader is free. So the file is checked before it gets there.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tacdata.errors import FormatError, UsageError
from tacdata.paths import StrPath

HAIR = 1e-6
"""Range given to a joint whose limits are equal [rad or m]."""
SHAPES = ("visual", "collision", "inertial", "transmission", "gazebo")
"""Elements of a URDF that kinematics does not need. Meshes are often missing where a trajectory is computed, and many
files hold impossible inertias.
"""
MOVING = {"revolute": "rad", "continuous": "rad", "prismatic": "m"}
"""Kind of a joint of one axis -> unit of its values."""
WIDEST = {"rad": 25.0, "m": 20.0}
"""Largest plausible limit of a joint [rad or m]: four turns, and the longest gantries. More are degrees or mm."""
FASTEST = {"rad": 50.0, "m": 20.0}
"""Largest plausible speed of a joint [rad/s or m/s]; many files give a large number for none."""
FARTHEST = 10.0
"""Largest plausible distance between two joints [m]; more are millimetres."""
TURN = 6.3
"""Largest plausible angle of an origin [rad]: a turn; more are degrees."""

PREFIX = re.compile(rb"[\s<]([A-Za-z_][\w.-]*):[A-Za-z_]")
"""A name with the prefix of a namespace, at the beginning of a tag or an attribute."""
UNBOUNDED = "the URDF gives no limits of the position, so none were kept"


@dataclass(frozen=True)
class Urdf:
    """The joints and links of a URDF that was checked."""

    text: str
    """The URDF without shapes and masses."""
    links: tuple[str, ...]
    joints: tuple[str, ...]
    velocity: dict[str, float]
    """Joint -> largest speed [rad/s or m/s]; joints without one are missing."""
    remarks: tuple[str, ...]
    """Remarks about the limits."""


def _is_utf8(text: bytes) -> bool:
    try:
        text.decode()
    except UnicodeDecodeError:
        return False
    return True


def read_urdf(path: StrPath) -> Urdf:
    """Read a URDF.

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is damaged, no tree of joints with one axis each, or in degrees or millimetres.
    """
    path = Path(path)
    if not path.is_file():
        raise UsageError(f"no URDF {path}", "a file named relative to the robot file", "correct urdf")
    text = path.read_bytes()
    try:
        root = _parsed(text)
    except (ET.ParseError, LookupError, ValueError) as error:
        if b"\0" in text[:4] or not _is_utf8(text) or "encoding" in str(error):
            raise FormatError(
                f"{path} is not in the encoding that it names, or that XML has without a name: {error}",
                "UTF-8, or another whose name the first line gives",
                "save it as UTF-8, and name that or none",
            ) from None
        raise FormatError(f"{path} is no XML: {error}", "a URDF", "export it again from the CAD or xacro") from None
    words = [word for element in root.iter() for word in (element.tag, *element.attrib.values())]
    if any(mark in word for word in words for mark in ("xacro", "${", "$(")):
        raise FormatError(
            f"{path} is a xacro whose macros are not expanded",
            "a URDF",
            f"make one: xacro {path.name} > {path.stem}_plain.urdf, and name that file",
        )
    links = [str(link.get("name")) for link in root.findall("link")]
    if root.tag != "robot" or not links:
        raise FormatError(f"{path}: <{root.tag}> with {len(links)} links", "<robot> with links", "give a URDF")
    joints = root.findall("joint")
    _check_tree(links, joints, path)
    velocity: dict[str, float] = {}
    remarks: dict[str, list[str]] = {}
    for joint in joints:
        _check_place(joint, path)
        if joint.get("type") in MOVING:
            speed, sentences = _checked_limits(joint, path)
            velocity |= speed
            for words in sentences:
                remarks.setdefault(words, []).append(_name(joint))
    _check_mimics(joints, path)
    for parent in root.iter():
        for child in [child for child in parent if child.tag in SHAPES]:
            parent.remove(child)
    names = tuple(_name(joint) for joint in joints)
    notes = tuple(f"joint {', '.join(which)}: {words}" for words, which in remarks.items())
    return Urdf(ET.tostring(root, encoding="unicode"), tuple(links), names, velocity, notes)


def _parsed(text: bytes) -> ET.Element:
    """Return the root of a file in the encoding that its first line names, or UTF-8; raises as `ET.fromstring`."""
    try:
        return ET.fromstring(text)
    except ET.ParseError as error:
        if "unbound prefix" not in str(error):
            raise
    # Published URDFs have attributes of one program, such as drake:acceleration, whose prefix is not declared.
    prefixes = {name for name in PREFIX.findall(text) if name != b"xmlns" and b"xmlns:" + name not in text}
    declared = b"".join(b' xmlns:%s="%s"' % (name, name) for name in sorted(prefixes))
    return ET.fromstring(text.replace(b"<robot", b"<robot" + declared, 1))


def _name(joint: ET.Element) -> str:
    return str(joint.get("name"))


def _wrong(path: Path, fault: str, allowed: str, next_step: str = "correct the URDF") -> FormatError:
    return FormatError(f"{path}: {fault}", allowed, next_step)


def _check_tree(links: list[str], joints: list[ET.Element], path: Path) -> None:
    """Refuse any structure but a tree of named links and joints."""
    for what, names in (("link", links), ("joint", [joint.get("name") for joint in joints])):
        if any(not name or name == "None" for name in names):
            raise _wrong(path, f"a {what} without name", f"a name for each {what}")
        twice = [str(name) for name, count in Counter(names).items() if count > 1]
        if twice:
            raise _wrong(path, f"{what} {', '.join(twice)} stands there twice", f"each {what} once")
    children: Counter[str] = Counter()
    for joint in joints:
        parts = [str(tag) for tag, count in Counter(part.tag for part in joint).items() if count > 1]
        if parts:
            raise _wrong(path, f"joint {_name(joint)} has {', '.join(parts)} twice", "each part of a joint once")
        kind = joint.get("type")
        if kind not in MOVING and kind != "fixed":
            raise _wrong(
                path,
                f"joint {_name(joint)} of type {kind!r}",
                f"fixed, {', '.join(MOVING)}",
                "fix the robot's base; put joints of one axis each in the place of others",
            )
        for end in ("parent", "child"):
            element = joint.find(end)
            link = None if element is None else element.get("link")
            if link not in links:
                raise _wrong(path, f"joint {_name(joint)}: {end} link {link!r} is not in the file", ", ".join(links))
            if end == "child":
                children[str(link)] += 1
    shared = [link for link, count in children.items() if count > 1]
    roots = [link for link in links if link not in children]
    if shared:
        raise _wrong(path, f"link {', '.join(shared)} hangs on two joints: a loop", "a tree", "cut the loop open")
    if len(roots) != 1:
        fault = f"links {', '.join(roots)} hang on no joint" if roots else "every link hangs on another: a loop"
        raise _wrong(path, fault, "one root, from which joints lead to all links", "add a fixed joint, or cut a loop")


def _numbers(joint: ET.Element, tag: str, attribute: str, path: Path) -> np.ndarray | None:
    """Return the three numbers of an attribute; None if it is left out."""
    element = joint.find(tag)
    text = None if element is None else element.get(attribute)
    if text is None:
        return None
    try:
        numbers = np.array([float(part) for part in text.split()])
    except ValueError:
        numbers = np.empty(0)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise _wrong(path, f"joint {_name(joint)}: {attribute} {text!r} of its {tag}", "three numbers, spaces between")
    return numbers


def _check_place(joint: ET.Element, path: Path) -> None:
    """Refuse an origin in millimetres or degrees, and an axis that points nowhere."""
    name = f"joint {_name(joint)}"
    place, turn, axis = (_numbers(joint, *key, path) for key in (("origin", "xyz"), ("origin", "rpy"), ("axis", "xyz")))
    if place is not None and (far := np.linalg.norm(place)) > FARTHEST:
        raise _wrong(
            path,
            f"{name} stands {far:g} m from the one before: are these millimetres?",
            f"metres, up to {FARTHEST:g} m",
            "export it in metres",
        )
    if turn is not None and (angle := np.abs(turn).max()) > TURN:
        raise _wrong(
            path,
            f"{name}: an origin turned by {angle:g} rad: are these degrees?",
            f"radians, up to {TURN:g} rad",
            "export it in radians",
        )
    if axis is not None and joint.get("type") in MOVING and not np.linalg.norm(axis) > 1e-6:
        raise _wrong(path, f"{name}: an axis of length 0", "a direction", "give the axis that it moves on")


def _checked_limits(joint: ET.Element, path: Path) -> tuple[dict[str, float], list[str]]:
    """Return a joint's speed limit, if it has one, and remarks on it; write its limits as MuJoCo understands them."""
    name, kind = _name(joint), str(joint.get("type"))
    unit, limit = MOVING[kind], joint.find("limit")
    bounds: dict[str, float] = {}
    for end in ("lower", "upper", "velocity"):
        text = None if limit is None else limit.get(end)
        if text is None:
            continue
        try:
            bounds[end] = float(text)
        except ValueError:
            bounds[end] = np.nan
        if np.isnan(bounds[end]):
            raise _wrong(path, f"joint {name}: {end} {text!r}", "numbers as limits")
    remarks = []
    ends = {end: value for end, value in bounds.items() if end != "velocity"}
    if kind != "continuous" and limit is not None:
        remarks += _bounded(joint, limit, ends, path)
    elif kind != "continuous":
        remarks.append(UNBOUNDED)
    speed = bounds.get("velocity", 0.0)
    if speed < 0:
        raise _wrong(path, f"joint {name}: a largest speed of {speed:g} {unit}/s", f"above 0 {unit}/s")
    if not 0 < speed < np.inf:
        return {}, remarks
    if speed > FASTEST[unit]:
        guess = "degrees or a stand-in" if unit == "rad" else "millimetres or a stand-in"
        remarks.append(
            f"a largest speed of {speed:g} {unit}/s is more than robots do ({guess}?); velocity in the robot file "
            "replaces it"
        )
    return {name: speed}, remarks


def _bounded(joint: ET.Element, limit: ET.Element, ends: dict[str, float], path: Path) -> list[str]:
    """Check the limits of a joint that is bounded; write them as MuJoCo understands them. Return remarks."""
    name, unit = _name(joint), MOVING[str(joint.get("type"))]
    low, high = ends.get("lower", 0.0), ends.get("upper", 0.0)  # the format's default
    if not ends or np.isinf([low, high]).all():
        for end in ("lower", "upper"):
            limit.attrib.pop(end, None)
        return [UNBOUNDED]
    extent = np.abs([value for value in (low, high) if np.isfinite(value)]).max()
    if extent > WIDEST[unit]:
        guess = "degrees" if unit == "rad" else "millimetres"
        raise _wrong(
            path,
            f"joint {name}: a limit of {extent:g} {unit}: are these {guess}?",
            f"{'radians' if unit == 'rad' else 'metres'}, up to {WIDEST[unit]:g} {unit}",
            f"export it in {'radians' if unit == 'rad' else 'metres'}",
        )
    if low > high:
        raise _wrong(path, f"joint {name}: lower {low:g} above upper {high:g} {unit}", "lower below upper")
    remarks = []
    if len(ends) == 1:
        missing = "upper" if "lower" in ends else "lower"
        remarks.append(f"the URDF gives no {missing} limit, so it is 0 {unit}, as the format says")
    if low == high:
        remarks.append(f"cannot move, as both limits are {low:g} {unit}")
        low, high = low - HAIR, high + HAIR  # MuJoCo takes equal limits for none
    low, high = (float(np.clip(value, -WIDEST[unit], WIDEST[unit])) for value in (low, high))
    # `repr` writes all digits of a float.
    limit.set("lower", repr(low))
    limit.set("upper", repr(high))
    return remarks


def _check_mimics(joints: list[ET.Element], path: Path) -> None:
    """Refuse joints that follow one that is not there, cannot move, or follows them."""
    leaders: dict[str, str] = {}
    kinds = {_name(joint): joint.get("type") for joint in joints}
    for joint in joints:
        element = joint.find("mimic")
        if element is None:
            continue
        name, leader = _name(joint), str(element.get("joint"))
        if kinds.get(leader) not in MOVING or joint.get("type") not in MOVING:
            able = [candidate for candidate, kind in kinds.items() if kind in MOVING and candidate != name]
            raise _wrong(path, f"joint {name} mimics {leader!r}", f"one that moves: {', '.join(able)}")
        for attribute in ("multiplier", "offset"):
            text = element.get(attribute, "0")
            try:
                fine = bool(np.isfinite(float(text)))
            except ValueError:
                fine = False
            if not fine:
                raise _wrong(path, f"joint {name}: {attribute} {text!r} of its mimic", "a number")
        leaders[name] = leader
    for name in leaders:
        chain, at = {name}, name
        while at in leaders:
            at = leaders[at]
            if at in chain:
                way = "itself" if at == name == leaders[name] else f"itself by way of {leaders[name]}"
                raise _wrong(path, f"joint {name} mimics {way}", "a leader that follows no other")
            chain.add(at)
