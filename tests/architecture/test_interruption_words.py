"""Ctrl-C in any verb ends in words and 130, never in a traceback or in silence."""

import pytest
import typer

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
