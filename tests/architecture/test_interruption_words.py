"""Ctrl-C in any verb ends in words and 130, never in a traceback or in silence."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer

import tacdata
from tacdata.cli import answering


def test_ctrl_c_is_answered(capsys):
    def verb(number: int = 3) -> None:
        raise KeyboardInterrupt

    with pytest.raises(typer.Exit) as ended:
        answering("tacdata verb", verb)()
    assert ended.value.exit_code == 130
    assert "what was finished is kept" in capsys.readouterr().err


def test_a_verb_keeps_its_options_and_its_answer():
    app = typer.Typer()

    def verb(number: int = 3) -> int:
        """Say a number."""
        return number

    app.command()(answering("tacdata verb", verb))
    assert answering("tacdata verb", verb)(5) == 5
    assert answering("tacdata verb", verb).__doc__ == "Say a number."


def test_ctrl_c_while_the_command_line_is_imported_ends_in_a_word(tmp_path):
    (tmp_path / "typer.py").write_text("raise KeyboardInterrupt")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(Path(tacdata.__file__).parents[1])])}
    ended = subprocess.run(
        [sys.executable, "-m", "tacdata.cli", "--help"], env=environment, capture_output=True, text=True
    )
    assert (ended.returncode, ended.stderr) == (130, "interrupted\n")
