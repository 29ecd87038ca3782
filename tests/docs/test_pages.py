"""What the pages say works: Python blocks run, commands are typed with arguments they have, links lead somewhere."""

import os
import re
import shlex
from pathlib import Path

import example_folder
import pytest
import typer.main

from tacdata.cli import application

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("docs", "examples", "benchmarks", "schemas", "tacdata", "label_farm", "training", "viewers")
PAGES = sorted([*ROOT.glob("*.md"), *(page for folder in FOLDERS for page in (ROOT / folder).rglob("*.md"))])
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def name(page):
    return str(page.relative_to(ROOT))


ELSEWHERE = "import fiftyone"
"""Blocks with this line run in an environment of their own, beside a server of a database: not here."""


def blocks(page, language):
    return [body for kind, body in BLOCK.findall(page.read_text()) if kind == language and ELSEWHERE not in body]


NOTEBOOKS = ROOT / "docs" / "notebooks"
"""Their code runs in the long part (tests/examples/test_notebooks.py)."""
GUIDES = [page for page in PAGES if page.parent == ROOT or page.is_relative_to(ROOT / "docs")]
GUIDES = [page for page in GUIDES if not page.is_relative_to(NOTEBOOKS)]
PYTHON = [page for page in GUIDES if blocks(page, "python")]
NOTEBOOKS = ROOT / "docs" / "notebooks"
"""Pages written by `.dev/notebooks.py`, which runs them whole (tests/examples/test_notebooks.py)."""
OF_ROOMS = [page for page in PAGES if page not in GUIDES and NOTEBOOKS not in page.parents and blocks(page, "python")]


@pytest.fixture(scope="module")
def verbs():
    return typer.main.get_command(application())


@pytest.mark.parametrize("page", PYTHON, ids=name)
def test_python_blocks_run_as_they_stand(page, tmp_path, monkeypatch, capsys):
    os.symlink(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    shared = {}
    for body in blocks(page, "python"):
        exec(compile(body, name(page), "exec"), shared)
    assert capsys.readouterr().out.strip()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A session with labels, its dataset and the shipped examples."""
    made = tmp_path_factory.mktemp("rooms")
    example_folder.fill(made)
    return made


@pytest.mark.parametrize("page", OF_ROOMS, ids=name)
def test_python_blocks_of_rooms_run_as_they_stand(page, folder, monkeypatch):
    monkeypatch.chdir(folder)
    shared = {}
    for body in blocks(page, "python"):
        exec(compile(body, name(page), "exec"), shared)


def commands(page):
    lines = [line.split("  #")[0].strip() for body in blocks(page, "sh") for line in body.splitlines()]
    return [shlex.split(line) for line in lines if line.startswith("tacdata ") or line.startswith(".venv/bin/tacdata ")]


def known(verbs, words):
    """Return the verb of a command line, and its words behind the verb's name."""
    command, rest = verbs, words[1:]
    while hasattr(command, "commands") and rest and not rest[0].startswith("-"):
        assert rest[0] in command.commands, f"no verb {rest[0]!r} in: {' '.join(words)}"
        command, rest = command.commands[rest[0]], rest[1:]
    return command, rest


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_commands_have_the_arguments_that_they_are_typed_with(page, verbs):
    for words in commands(page):
        command, rest = known(verbs, words)
        options = {option for parameter in command.params for option in parameter.opts + parameter.secondary_opts}
        typed = {word.split("=")[0] for word in rest if word.startswith("--")} - {"--help"}
        assert typed <= options, f"{' '.join(words)}: no {typed - options}"


PATHS = re.compile(rf"`((?:{'|'.join(FOLDERS)}|tests|\\.dev|\\.ci)/[\\w./-]+)`")


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != "CHANGELOG.md"], ids=name)
def test_paths_in_backquotes_are_there(page):
    assert not [
        path for path in PATHS.findall(page.read_text()) if not re.search("my_", path) and not (ROOT / path).exists()
    ]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_and_pictures_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), f"{name(page)}: {target}"


def test_pictures_are_small_enough_for_the_repository():
    assert sum(path.stat().st_size for path in (ROOT / "docs" / "pictures").iterdir()) < 1_500_000
