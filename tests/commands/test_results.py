"""What a verb found comes as JSON, hints and progress can be left out, and exit codes stand in one table."""

import inspect
import json
import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tacdata import cli, errors, progress, registry
from tacdata.commands.command import Result, plain
from tacdata.errors import Exit, SolveError, TacdataError
from tacdata.example.shipped import SESSION

ROOT = Path(__file__).resolve().parents[2]
APP = cli.application()
REPORT = (
    "browse",
    "check",
    "compare",
    "demo",
    "discrepancy",
    "evaluate",
    "example",
    "generalize",
    "label",
    "list",
    "pack",
    "pictures",
    "plan",
    "protocols",
    "record",
    "register",
    "replay",
    "report",
    "revise",
    "solve",
    "success",
    "surrogate",
    "train",
    "view",
    "farm cancel",
    "farm dataset",
    "farm fetch",
    "farm status",
    "farm submit",
)
"""Verbs that find something out."""


def tacdata(*arguments):
    return CliRunner().invoke(APP, [str(argument) for argument in arguments])


@pytest.mark.parametrize("verb", REPORT)
def test_a_verb_that_finds_something_out_has_json(verb):
    room, name = (f"{cli.ROOM}.farm", verb[5:]) if verb.startswith("farm ") else (cli.ROOM, verb)
    module = registry.load_module(room, cli.BASE, name.replace("-", "_"))
    assert inspect.signature(module.run, eval_str=True).return_annotation is Result
    shown = tacdata(*verb.split(), "--help")
    assert shown.exit_code == Exit.DONE
    assert "--json" in shown.output and "--quiet" in shown.output


def test_a_list_as_json_is_nothing_but_json():
    members = json.loads(tacdata("list", "indenters", "--json").stdout)
    (sphere,) = (member for member in members if member["name"] == "sphere")
    assert sphere["parameters"]["radius"].endswith("[mm].")
    folders = {folder["name"]: folder["members"] for folder in json.loads(tacdata("list", "--json").stdout)}
    assert folders["indenters"] == len(members)


def test_a_plan_as_json_is_the_plan_that_is_written(tmp_path):
    import yaml

    shown = tacdata("plan", "--presses", 3, "--seed", 2, "--out", tmp_path / "plan.yaml", "--json")
    found = json.loads(shown.stdout)
    assert found["plan"] == yaml.safe_load((tmp_path / "plan.yaml").read_text())
    assert found["written"] == str(tmp_path / "plan.yaml")
    assert "3 presses" in shown.stderr


def test_rates_as_json():
    (rate,) = json.loads(tacdata("success", "dense=35/40", "--json").stdout)["rates"]
    assert (rate["successes"], rate["trials"]) == (35, 40)
    assert rate["interval"] == pytest.approx([0.7389, 0.9454], abs=1e-4)


def test_what_is_unfit_is_told_as_json_before_the_exit_code(tmp_path):
    (tmp_path / "cut.mcap").write_bytes((SESSION / "episode-000000.mcap").read_bytes()[:20_000])
    shown = tacdata("check", tmp_path / "cut.mcap", "--json")
    assert shown.exit_code == Exit.UNFIT
    assert json.loads(shown.stdout)["usable"] is False


def test_quiet_leaves_out_hints_and_keeps_results(tmp_path):
    loud, quiet = tacdata("list"), tacdata("list", "--quiet")
    assert "next:" in loud.stdout and "next:" not in quiet.stdout
    assert quiet.stdout.splitlines() == [line for line in loud.stdout.splitlines() if line and "next:" not in line]
    assert tacdata("--quiet", "list").stdout == quiet.stdout
    assert not progress.is_quiet()


def test_quiet_silences_bars_and_spinners(capsys):
    with progress.silenced(True):
        with progress.bars("{task.description}") as bar:
            bar.add_task("work", total=2)
            bar.print("epoch 1")
        progress.console().print("written")
        progress.say("press 1 of 2")
    assert capsys.readouterr() == ("", "")
    progress.say("press 2 of 2")
    assert capsys.readouterr().out == "press 2 of 2\n"


def test_a_result_that_ends_in_an_error_prints_both(capsys):
    def verb() -> Result:
        print("words")
        return Result({"failed": 1}, SolveError("1 of 2 has no label", "a label for each", "try again"))

    with pytest.raises(SolveError):
        cli.answering("tacdata verb", verb)(as_json=True)
    out, err = capsys.readouterr()
    assert json.loads(out) == {"failed": 1}
    assert err == "words\n"


def test_arrays_paths_and_what_is_not_finite_become_json():
    given = {"a": np.array([1.0, np.nan]), "b": Path("x/y"), "c": np.float64(2.5), "d": (Exit.DONE,), 3: {1}}
    assert json.loads(Result(given).text) == {"a": [1.0, None], "b": "x/y", "c": 2.5, "d": [0], "3": [1]}
    assert plain(float("inf")) is None


def test_an_error_survives_the_way_between_processes():
    error = pickle.loads(pickle.dumps(SolveError("1 N", "2 N", "press less")))
    assert (error.given, error.allowed, error.remedy) == ("1 N", "2 N", "press less")
    assert str(error) == "1 N\n  allowed: 2 N\n  next:    press less"


def test_the_neighbour_of_a_mistyped_path_is_offered(tmp_path, monkeypatch, capsys):
    (tmp_path / "session").mkdir()
    monkeypatch.setattr("sys.argv", ["tacdata", "check", str(tmp_path / "sesion")])
    with pytest.raises(SystemExit):
        cli.main()
    assert f"next:    did you mean {tmp_path / 'session'}? " in capsys.readouterr().err


def test_every_error_ends_with_a_code_of_the_table():
    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, TacdataError)]
    assert len(kinds) >= 6
    assert all(isinstance(kind.exit_code, Exit) and kind.exit_code != Exit.DONE for kind in kinds)


def test_the_page_of_exit_codes_is_the_table():
    page = (ROOT / "docs" / "reference" / "exit_codes.md").read_text()
    rows = re.findall(r"^\| (\d+) \| `(\w+)` \| (.+) \|$", page, re.M)
    assert rows == [(str(code.value), code.name, code.meaning) for code in Exit]


def test_no_verb_ends_with_a_bare_number():
    bare = re.compile(r"(?:typer\.Exit|SystemExit)\(\s*\d+|exit_code\s*=\s*\d+")
    for room in ("tacdata", "label_farm", "training", "viewers"):
        for path in (ROOT / room).rglob("*.py"):
            assert not bare.search(path.read_text()), path


def test_version_says_release_and_commit():
    assert re.fullmatch(r"tacdata \d+\.\d+\.\d+ \(commit [0-9a-f]{7,}(\.dirty)?\)\n", tacdata("--version").stdout)


def test_a_shell_can_complete_verbs(monkeypatch):
    monkeypatch.setenv("_TACDATA_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "tacdata ev")
    monkeypatch.setenv("COMP_CWORD", "1")
    shown = CliRunner().invoke(APP, [], prog_name="tacdata")
    assert shown.output.split() == ["evaluate"]
    monkeypatch.delenv("_TACDATA_COMPLETE")
    assert "--install-completion" in tacdata("--help").output


def test_no_time_is_estimated_from_the_first_items_of_a_batch():
    assert progress.remaining(1, 7339, 87.0) == ""
    assert progress.remaining(4, 50, 40.0) == ""
    assert progress.remaining(5, 50, 50.0) == "about 8 min left"
    assert progress.remaining(40, 50, 40.0) == "about 10 s left"
    assert progress.remaining(50, 50, 50.0) == ""
    assert progress.remaining(0, 0, 0.0) == ""
