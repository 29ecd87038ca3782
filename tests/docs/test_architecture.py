"""ARCHITECTURE.md shows the house as it is: every room and the rooms inside it, in the order of imports."""

import configparser
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROW = re.compile(r"^\| `([\w/]+)` \| [^|]+ \| ([^|]*) ?\|$", re.MULTILINE)
ROOMS = {room: re.findall(r"`(\w+)`", inside) for room, inside in ROW.findall((ROOT / "ARCHITECTURE.md").read_text())}


def layers():
    """Return the lines of the contract of directions, the floor first."""
    parser = configparser.ConfigParser(comment_prefixes=(";",))
    parser.read(ROOT / ".importlinter")
    lines = parser["importlinter:contract:directions"]["layers"].split("\n")
    return [[module.strip().replace(".", "/") for module in line.split("|")] for line in reversed(lines) if line]


@pytest.mark.parametrize("room", ROOMS)
def test_the_rooms_inside_a_room_are_listed(room):
    assert ROOMS[room] == sorted(path.parent.name for path in (ROOT / room).glob("*/__init__.py"))


def test_rooms_stand_in_the_order_of_imports():
    place = {module: k for k, line in enumerate(layers()) for module in line}
    order = [place[room] for room in ROOMS]
    assert len(order) > 25
    assert order == sorted(order)
