"""The troubleshooting page holds every error message of the source, and is current."""

import importlib.util
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / ".dev" / "troubleshooting.py"


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("troubleshooting", SCRIPT)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules["troubleshooting"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["troubleshooting"]


@pytest.fixture(scope="module")
def entries(script):
    return script.entries()


def test_the_page_is_current(script, entries):
    assert script.PAGE.read_text() == script.page(entries), f"run {SCRIPT.relative_to(ROOT)}"


def test_every_entry_says_what_was_given_what_is_allowed_and_what_to_do(entries):
    assert len(entries) > 500
    for entry in entries:
        for part in (entry.given, entry.allowed, entry.remedy):
            assert re.search(r"[A-Za-z]{2}", part), entry


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        (
            'raise UsageError(f"no file {path}", "a recording", "check the path")',
            ("no file …", "a recording", "check the path"),
        ),
        (
            'given = "no plan"\nraise UsageError(given, ", ".join(known), NEXT)',
            ("no plan", "as listed in the message", "make one"),
        ),
        ('raise Late("late by " + f"{s} s", "at once", "hurry")', ("late by … s", "at once", "hurry")),
        ('raise UsageError(str(error), "a number", "correct it")', None),
        ('raise ValueError("given", "allowed", "remedy")', None),
    ],
)
def test_messages_are_read_as_a_person_meets_them(script, source, expected, tmp_path, monkeypatch):
    monkeypatch.setattr(script, "ROOT", tmp_path)
    monkeypatch.setattr(script, "ROOMS", ("room",))
    (tmp_path / "room").mkdir()
    head = 'NEXT = "make one"\nclass UsageError(TacdataError): ...\nclass Late(UsageError): ...\n'
    (tmp_path / "room" / "verb.py").write_text(head + source + "\n")
    found = [(entry.given, entry.allowed, entry.remedy) for entry in script.entries()]
    assert found == ([expected] if expected else [])
