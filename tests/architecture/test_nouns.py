"""Every array in a dataclass says its unit and its shape on the line below the field."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("tacdata", "label_farm", "training", "viewers")
FILES = sorted(p for room in ROOMS for p in (ROOT / room).rglob("*.py") if not p.name.endswith("_pb2.py"))
NOUNS = (
    "tacdata/sensor/sensor.py",
    "tacdata/recording/episode.py",
    "tacdata/labels/label.py",
    "tacdata/devices/device.py",
)


def array_fields(source):
    """Yield (class, field, docstring) of every array field of every public dataclass."""
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.ClassDef) or node.name.startswith("_"):
            continue
        if not any("dataclass" in ast.unparse(decorator) for decorator in node.decorator_list):
            continue
        for statement, following in zip(node.body, [*node.body[1:], None], strict=True):
            if not isinstance(statement, ast.AnnAssign):
                continue
            annotation = ast.unparse(statement.annotation)
            if "ndarray" not in annotation or annotation.startswith("dict"):
                continue
            text = (
                following.value.value
                if (
                    isinstance(following, ast.Expr)
                    and isinstance(following.value, ast.Constant)
                    and isinstance(following.value.value, str)
                )
                else ""
            )
            yield node.name, ast.unparse(statement.target), text


def shortcoming(text):
    """Return what a field's docstring lacks, or nothing."""
    if not text:
        return "no docstring"
    # Pictures, numbers of things and flags have no unit and say their type; a pure number has the unit [1].
    if not re.search(r"\[[^\]]+\]|\b(u?int(8|16|32|64)?|bool|ind(ex|ices))\b", text):
        return "no [unit]"
    if not re.search(r"\bshape\b", text):
        return "no shape"
    return None


def test_the_walk_finds_what_it_should():
    source = '''
@dataclass(frozen=True)
class A:
    good: np.ndarray
    """Height [mm], shape (n,)."""
    unitless: np.ndarray
    """Height, shape (n,)."""
    shapeless: np.ndarray
    """Height [mm]."""
    bare: np.ndarray
    number: float
'''
    found = {field: shortcoming(text) for _, field, text in array_fields(source)}
    assert found == {"good": None, "unitless": "no [unit]", "shapeless": "no shape", "bare": "no docstring"}


@pytest.mark.parametrize("name", NOUNS)
def test_the_nouns_do_hold_arrays(name):
    assert list(array_fields((ROOT / name).read_text())) or name == "tacdata/sensor/sensor.py"


def test_every_array_field_has_unit_and_shape():
    wrong = {}
    for path in FILES:
        for kind, field, text in array_fields(path.read_text()):
            if lack := shortcoming(text):
                wrong[f"{path.relative_to(ROOT)}: {kind}.{field}"] = lack
    assert not wrong
