"""The command line is the folder of verbs: complete, in the order of the pipeline, and light to start."""

import inspect
import re
import subprocess
import sys

import pytest

from tacdata import cli, registry
from tacdata.commands.command import PIPELINE, TOOLS

VERBS = registry.names(cli.ROOM, cli.BASE)
HEAVY = {"torch", "warp", "lerobot", "rerun", "cv2", "matplotlib", "pyvista", "pytetwild", "scipy", "pyarrow", "mcap"}


def module(name):
    return registry.load_module(cli.ROOM, cli.BASE, name)


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_says_where_it_stands_and_what_it_does(name):
    verb = module(name)
    assert isinstance(verb.ORDER, int)
    assert verb.PANEL in (PIPELINE, TOOLS)
    assert (verb.PANEL == PIPELINE) == (verb.ORDER < 100), "pipeline verbs stand below 100, tools from 100 on"
    first = (inspect.getdoc(verb.run) or "").splitlines()[0]
    assert first.endswith("."), f"{name}: the first line of run's docstring is what --help shows"


def test_no_two_verbs_of_the_pipeline_claim_one_place():
    places = [module(name).ORDER for name in VERBS if module(name).PANEL == PIPELINE]
    assert len(places) == len(set(places))


def test_help_lists_every_verb_in_the_order_of_the_pipeline():
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
    expected = sorted(VERBS, key=lambda name: (module(name).ORDER, module(name).__name__))
    pipeline = [name.replace("_", "-") for name in expected if module(name).PANEL == PIPELINE]
    assert [verb for verb in listed if verb in pipeline] == pipeline
    assert sorted(listed) == sorted(name.replace("_", "-") for name in VERBS)


def test_the_pipeline_of_the_readme_exists():
    """The verbs that a lab types, in this order; nothing may quietly leave the pipeline."""
    expected = ["record", "check", "label", "pack", "train", "evaluate", "view"]
    assert [v for v in sorted(VERBS, key=lambda n: module(n).ORDER) if v in expected] == expected


def test_starting_the_command_line_imports_nothing_heavy():
    code = "import sys; from tacdata import cli; cli.application(); print(*sys.modules)"
    loaded = set(
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    )
    loaded = {module.split(".")[0] for module in loaded}
    assert "typer" in loaded
    assert not loaded & HEAVY
