"""The command line is the folder of verbs: complete, by task, with examples, and light to start."""

import inspect
import json
import re
import shlex
import subprocess
import sys

import pytest
import typer
from running.in_process import tacdata

from tacdata import cli, registry
from tacdata.commands.command import TASKS, members

VERBS = registry.names(cli.ROOM, cli.BASE)
HEAVY = {"torch", "warp", "lerobot", "rerun", "cv2", "matplotlib", "pyvista", "pytetwild", "scipy", "pyarrow", "mcap"}


def module(name):
    return registry.load_module(cli.ROOM, cli.BASE, name)


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_says_where_it_stands_and_what_it_does(name):
    verb = module(name)
    assert isinstance(verb.ORDER, int)
    assert verb.PANEL in TASKS
    first = (inspect.getdoc(verb.run) or "").splitlines()[0]
    assert first.endswith("."), f"{name}: the first line of run's docstring is what --help shows"


def test_no_two_verbs_of_a_task_claim_one_place():
    places = [(module(name).PANEL, module(name).ORDER) for name in VERBS]
    assert len(places) == len(set(places))


def _examples():
    """The examples of every verb, and of the verbs below a verb."""
    for verb, name in members(cli.ROOM, cli.BASE):
        for part in members(verb.__name__, cli.BASE) if hasattr(verb, "__path__") else [(verb, name)]:
            yield pytest.param(part[0].EXAMPLES, id=part[0].__name__.removeprefix(cli.ROOM + "."))


@pytest.mark.parametrize("examples", list(_examples()))
def test_three_examples_of_a_verb_parse(examples):
    assert len(examples) == 3
    assert len(set(examples)) == 3
    command = typer.main.get_command(cli.application())
    for line in examples:
        program, *words = shlex.split(line)
        assert program == "tacdata"
        with command.make_context("tacdata", words) as context:
            verb_name, verb, rest = command.resolve_command(context, words)
            while hasattr(verb, "resolve_command"):
                verb_name, verb, rest = verb.resolve_command(context, rest)
            parsed = verb.make_context(verb_name, rest)
        assert parsed.params


def test_help_has_the_examples_and_a_short_option():
    short, long = (tacdata("check", option).stdout for option in ("-h", "--help"))
    assert short == long
    assert all(line in short for line in module("check").EXAMPLES)


def test_help_lists_every_verb_by_task_in_order():
    shown = subprocess.run(
        [sys.executable, "-m", "tacdata.cli", "--help"],
        capture_output=True,
        text=True,
        check=True,
        env={"COLUMNS": "200", "TERM": "dumb"},
    ).stdout
    listed = [
        verb for verb in re.findall(r"^[│|\s]*([a-z][a-z-]*)\s{2,}\S", shown, re.M) if verb.replace("-", "_") in VERBS
    ]
    assert sorted(listed) == sorted(name.replace("_", "-") for name in VERBS)
    for task in TASKS:
        expected = [name for verb, name in members(cli.ROOM, cli.BASE) if verb.PANEL == task and name in listed]
        plain = [name for name in expected if not hasattr(module(name.replace("-", "_")), "__path__")]
        assert [verb for verb in listed if verb in plain] == plain, task
    assert [task for task in TASKS if task in shown] == list(TASKS)


def test_the_pipeline_of_the_readme_exists():
    """The verbs that a lab types, in this order; nothing may quietly leave the pipeline."""
    expected = ["record", "check", "view", "label", "pack", "train", "evaluate", "discrepancy"]
    assert [name for _, name in members(cli.ROOM, cli.BASE) if name in expected] == expected


def test_the_list_of_verbs_is_that_of_the_help():
    listed = json.loads(tacdata("list", "verbs", "--json").stdout)
    assert [verb["name"] for verb in listed] == [name for _, name in members(cli.ROOM, cli.BASE)]
    assert all(verb["task"] in TASKS and verb["meaning"].endswith(".") for verb in listed)


def test_starting_the_command_line_imports_nothing_heavy():
    code = "import sys; from tacdata import cli; cli.application(); print(*sys.modules)"
    loaded = set(
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    )
    loaded = {module.split(".")[0] for module in loaded}
    assert "typer" in loaded
    assert not loaded & HEAVY
