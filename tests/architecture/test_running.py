"""How the tests are run: what decides a long test, and what a run says at its end."""

import ast
import importlib.util
from pathlib import Path

import pytest
from running import long_part

ROOT = Path(__file__).resolve().parents[2]


def marks():
    """Yield (file, mark) of every use of the mark `long`."""
    for path in (ROOT / "tests").rglob("test_*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "pytest.mark.long":
                yield path.name, node


def test_every_long_test_says_why_and_names_rooms_that_exist():
    found = list(marks())
    assert len(found) > 5
    for name, mark in found:
        assert mark.args and [word.arg for word in mark.keywords] == ["reason"], name
        for room in mark.args:
            assert (ROOT / ast.literal_eval(room)).exists(), f"{name}: {ast.unparse(room)}"


def test_words_decide_no_long_test_and_constants_do(tmp_path):
    texts = ('"""One."""\nA = 1  # so\n', '"""Two."""\n\nA = 1\n', '"""One."""\nA = 2\n')
    paths = [tmp_path / f"{k}.py" for k in range(3)]
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text)
    one, reworded, changed = map(long_part._content, paths)
    assert one == reworded != changed


def test_a_room_brings_what_it_imports():
    rooms = long_part.closure(["label_farm"])
    assert {"label_farm", "tacdata/skin", "tacdata/sensor", "tacdata/errors.py"} <= rooms
    assert not rooms & {"viewers", "training"}


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["= 3 passed, 1 skipped in 2.00s ="], "3 passed, 1 skipped in 7.00s (00:00:07)"),
        (["= 1 failed, 3 passed in 2s =", "= 2 passed, 1 error in 1s ="], "1 failed, 5 passed, 1 error in 7.00s"),
        (["no tests ran in 0.10s"], "no tests ran in 7.00s"),
    ],
)
def test_the_last_line_is_one_of_pytests(lines, words):
    spec = importlib.util.spec_from_file_location("suite", ROOT / ".dev" / "suite.py")
    assert spec and spec.loader
    suite = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(suite)
    assert words in suite._sum(lines, 7.0)
