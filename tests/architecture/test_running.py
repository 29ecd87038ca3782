"""How the tests are run: what decides a long test, who takes which file, and what a run says at its end."""

import ast
import gc
import importlib.util
import subprocess
import sys
from collections import OrderedDict
from pathlib import Path
from types import SimpleNamespace

import pytest
from running import long_part, rewritten, side_by_side
from xdist.scheduler import LoadFileScheduling

ROOT = Path(__file__).resolve().parents[2]


def marks():
    """Yield (file, mark) of every use of the mark `long`."""
    for path in (ROOT / "tests").rglob("test_*.py"):
        if "pytest.mark.long" not in (text := path.read_text()):
            continue
        for node in ast.walk(ast.parse(text)):
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
    texts = ('"""One."""\nA = 1  # so\n', '"""Two."""\n\nA = 1\n"""A count."""\n', '"""One."""\nA = 2\n')
    paths = [tmp_path / f"{k}.py" for k in range(3)]
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text)
    one, reworded, changed = map(long_part._content, paths)
    assert one == reworded != changed
    page, block = tmp_path / "page.md", "```sh\ntacdata list\n```\n"
    contents = []
    for text in (f"So.\n{block}", f"Otherwise.\n{block}", f"So.\n{block.replace('list', 'plan')}"):
        long_part._content.cache_clear()
        page.write_text(text)
        contents.append(long_part._content(page))
    assert contents[0] == contents[1] != contents[2]


def test_a_room_brings_what_it_imports():
    rooms = long_part.closure(["label_farm"])
    assert {"label_farm", "tacdata/skin", "tacdata/sensor", "tacdata/errors.py"} <= rooms
    assert not rooms & {"viewers", "training"}


@pytest.mark.parametrize("asked", ["tests/wire", "tests"])
def test_only_files_that_were_asked_for_are_said_to_have_passed_before(asked):
    option = SimpleNamespace(keyword="", long="changed", maxfail=0)
    config = SimpleNamespace(args=[asked], option=option, invocation_params=SimpleNamespace(dir=ROOT))
    passed = long_part.Passed(config)
    file = next(name for name in long_part.record() if not name.startswith("tests/wire") and (ROOT / name).exists())
    assert passed.left_as_passed(ROOT / file) == (asked == "tests")
    assert not passed.left_as_passed(ROOT / "tests" / "test_gone.py")


def test_files_without_a_long_test_are_not_imported_for_the_long_part():
    config = SimpleNamespace(option=SimpleNamespace(long="changed"))
    ignored = {path for path in (ROOT / "tests").rglob("*.py") if long_part.pytest_ignore_collect(path, config)}
    assert len(ignored) > 200 and not [path for path in ignored if "mark.long" in path.read_text()]
    assert all(path.name.startswith("test_") for path in ignored)


def test_the_longest_file_of_a_kind_goes_first_and_nobody_idles(monkeypatch):
    files = ["tests/skin/short.py", "tests/skin/long.py", "tests/live/short.py", "tests/live/long.py"]
    monkeypatch.setattr(side_by_side, "recorded", lambda: {file: 9.0 if "long" in file else 1.0 for file in files})
    scheduler, given = object.__new__(side_by_side.ByKind), []
    take_first = lambda self, node: given.append(self.workqueue.popitem(last=False)[0])  # noqa: E731
    monkeypatch.setattr(LoadFileScheduling, "_assign_work_unit", take_first)
    scheduler.config = SimpleNamespace(option=SimpleNamespace(waiting=1, long=None))
    scheduler.workqueue = OrderedDict.fromkeys(files)
    for worker in ("gw1", "gw0", "gw0", "gw0"):
        scheduler._assign_work_unit(SimpleNamespace(gateway=SimpleNamespace(id=worker)))
    assert given == [files[1], files[3], files[2], files[0]]


def test_rooms_that_compile_the_same_go_to_one_process():
    scheduler = object.__new__(side_by_side.ByKind)
    tests = ["tests/skin/mesh/test_a.py::a", "tests/skin/solve/test_b.py::b", "tests/live/test_c.py::c"]
    files = [test[:-3] for test in tests]
    for long, scopes in ((None, ["tests/skin", "tests/skin", files[2]]), ("all", files)):
        scheduler.config = SimpleNamespace(option=SimpleNamespace(long=long))
        assert [scheduler._split_scope(test) for test in tests] == scopes


def test_pytest_takes_what_was_rewritten_before_it_started(tmp_path):
    """What was written says something else than the file: whoever runs it, took it."""
    path, other = tmp_path / "test_a.py", tmp_path / "b" / "test_a.py"
    other.parent.mkdir()
    path.write_text("def test_a():\n    assert 1 == 2\n")
    rewritten.write(path)
    kept = rewritten.place(path).read_bytes()
    other.write_text("def test_a():\n    assert 1 == 1\n")
    rewritten.write(other)
    head = 16  # magic number, flags, hash of the source
    rewritten.place(path).write_bytes(kept[:head] + rewritten.place(other).read_bytes()[head:])
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-c", "/dev/null", "--rootdir", str(tmp_path), str(path)],
        capture_output=True,
        text=True,
    )
    assert "1 passed" in done.stdout, done.stdout


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["= 3 passed, 1 skipped in 2.00s ="], "3 passed, 1 skipped in 7.00s (00:00:07)"),
        (["= 1 failed, 3 passed in 2s =", "= 2 passed, 1 error in 1s ="], "1 failed, 5 passed, 1 error in 7.00s"),
        (["= 5 passed in 2s =", "= 9 deselected in 1s ="], "5 passed in 7.00s"),
        (["no tests ran in 0.10s"], "no tests ran in 7.00s"),
    ],
)
def test_the_last_line_is_one_of_pytests(lines, words):
    spec = importlib.util.spec_from_file_location("suite", ROOT / ".dev" / "suite.py")
    assert spec and spec.loader
    suite = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(suite)
    assert words in suite._sum(lines, 7.0)


def test_garbage_is_looked_for_again_once_all_is_collected():
    assert gc.isenabled() and gc.get_freeze_count() > 10_000  # one small file alone brings 45,000
