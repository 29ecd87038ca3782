"""One word, one thing: a public class name stands for one class in the whole code, a test file's for one file."""

import ast
from collections import Counter, defaultdict
from pathlib import Path

from tacdata import catalogue, registry

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("tacdata", "label_farm", "training", "viewers")
FILES = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py") if not path.name.endswith("_pb2.py"))


def registry_files():
    """Return the files of registries: a member is asked for by its file's name, which a person reads in a list."""
    found = set()
    for each in catalogue.registries().values():
        folder = (ROOT / each.room.replace(".", "/")).resolve()
        found |= {folder / f"{name}.py" for name in registry.names(each.room, each.base)}
    return found


def stand_for_several(files):
    """Return the public class names that stand in several files, with these files."""
    found = defaultdict(list)
    for path in files:
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found[node.name].append(path)
    return {name: places for name, places in found.items() if len(places) > 1}


def test_two_classes_of_one_name_are_found(tmp_path):
    for name in ("a.py", "b.py"):
        (tmp_path / name).write_text("class Same: pass\nclass _Own: pass\n")
    assert list(stand_for_several(sorted(tmp_path.glob("*.py")))) == ["Same"]


def test_registries_are_found():
    assert ROOT / "tacdata/exporters/csv.py" in registry_files()
    assert ROOT / "tacdata/exporters/exporter.py" not in registry_files()


def test_a_public_class_name_stands_for_one_thing():
    members = registry_files()
    found = stand_for_several(path for path in FILES if path not in members)
    assert not found


def test_every_test_file_has_a_name_of_its_own():
    """Pytest imports each by its bare name, and refuses the second."""
    names = Counter(path.name for path in (ROOT / "tests").rglob("test_*.py"))
    shared = sorted(name for name, count in names.items() if count > 1)
    assert len(names) > 100
    assert not shared, f"{shared}: rename all but one of each, pytest collects a whole room group at once"
