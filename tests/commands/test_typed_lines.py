"""A line that does not fit a verb is answered as any error: what was given, what is allowed, what is next."""

import pytest
from running.in_process import tacdata

LINES = {
    "check": ("tacdata check without path", "tacdata check [OPTIONS]", "name it; tacdata check --help explains each"),
    "check a b c": ("tacdata check with b c, which it has no place for", "tacdata check [OPTIONS]", "leave it out"),
    "check --nope a": ("tacdata check with --nope", "--help, --json, --out, --quiet", "tacdata check --help"),
    "check --jsn a": ("tacdata check with --jsn", "--help, --json", "did you mean --json? tacdata check --help"),
    "example --out x": ("tacdata example with --out", "--quiet", "next:    tacdata example --help explains each"),
    "chek a": ("tacdata has no verb 'chek'", "register, plan, record, check", "did you mean check? tacdata --help"),
    "farm statu": ("tacdata farm has no verb 'statu'", "status", "did you mean status? tacdata farm --help"),
    "farm nope": ("tacdata farm has no verb 'nope'", "up, send, submit", "tacdata farm --help explains each"),
    "record --rig": ("--rig without a value", "a value behind it", "name it"),
    "record --plan p": ("tacdata record without --", "tacdata record [OPTIONS]", "name it; tacdata record --help"),
    "label --workers x y": ("tacdata label: Invalid value for '--workers'", "tacdata label [OPTIONS]", "--help"),
}


@pytest.mark.parametrize("line", LINES)
def test_a_line_that_does_not_fit_says_what_is_allowed_and_what_is_next(line, tmp_path):
    given, allowed, remedy = LINES[line]
    done = tacdata(*line.split(), folder=tmp_path)
    assert done.returncode == 2
    first, second, third = done.stderr.splitlines()
    assert first.startswith(f"error: {given}")
    assert second.startswith("  allowed: ") and allowed in second
    assert third.startswith("  next:    ") and remedy in third
    assert done.stdout == ""


@pytest.mark.parametrize(("line", "code"), [("--version", 0), ("check --help", 0), ("", 2), ("farm", 2)])
def test_help_and_version_end_as_before(line, code):
    done = tacdata(*line.split())
    assert done.returncode == code
    assert "tacdata" in done.stdout + done.stderr


def test_a_path_that_does_not_exist_is_answered_with_its_neighbour(tmp_path):
    (tmp_path / "monday" / "session").mkdir(parents=True)
    for typed, meant in (("monday/sesion", "monday/session"), ("mondya/session", "monday")):
        done = tacdata("check", typed, folder=tmp_path)
        assert done.returncode == 2
        assert f"next:    did you mean {meant}?" in done.stderr
    assert "did you mean" not in tacdata("check", "xyz", folder=tmp_path).stderr
