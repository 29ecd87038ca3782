"""ARCHITECTURE.md shows the house as it is: every room and the rooms inside it, in the order of imports."""

import configparser
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROW = re.compile(r"^\| `([\w/]+)` \| [^|]+ \| ([^|]*) ?\|$", re.MULTILINE)
ROOMS = {room: re.findall(r"`(\w+)`", inside) for room, inside in ROW.findall((ROOT / "ARCHITECTURE.md").read_text())}


def _folder(module):
    """Return a room's folder: four packages of tacdata are at the top of the clone."""
    path = module.replace(".", "/")
    return path.removeprefix("tacdata/") if (ROOT / path).is_symlink() else path


def _folder(module):
    """Return a room's folder: four packages of tacdata are at the top of the clone."""
    path = module.replace(".", "/")
    return path.removeprefix("tacdata/") if (ROOT / path).is_symlink() else path


def layers():
    """Return the lines of the contract of directions, the floor first."""
    parser = configparser.ConfigParser(comment_prefixes=(";",))
    parser.read(ROOT / ".importlinter")
    lines = parser["importlinter:contract:directions"]["layers"].split("\n")
    return [[_folder(module.strip()) for module in line.split("|")] for line in reversed(lines) if line]


@pytest.mark.parametrize("room", ROOMS)
def test_the_rooms_inside_a_room_are_listed(room):
    folders = (path.parent for path in (ROOT / room).glob("*/__init__.py"))
    assert ROOMS[room] == sorted(folder.name for folder in folders if not folder.is_symlink())


def test_rooms_stand_in_the_order_of_imports():
    place = {module: k for k, line in enumerate(layers()) for module in line}
    order = [place[room] for room in ROOMS]
    assert len(order) > 25
    assert order == sorted(order)
