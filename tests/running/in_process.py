"""The command run in this process: a verb in a process of its own takes a second of the processor to start."""

import io
import sys
from contextlib import redirect_stderr, redirect_stdout
from subprocess import CompletedProcess

import pytest

from tacdata import cli


def tacdata(*arguments, folder=None, answer="", **environment):
    """Run `tacdata ARGUMENTS` in a folder as if typed; return what a process would have: exit code and words.

    An exception that would end it in a traceback fails the test.
    """
    out, errors, code = io.StringIO(), io.StringIO(), 0
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(errors):
        patch.setattr(sys, "argv", ["tacdata", *map(str, arguments)])
        patch.setattr(sys, "stdin", io.StringIO(answer))
        if folder is not None:
            patch.chdir(folder)
        for name, value in environment.items():
            patch.setenv(name, value)
        try:
            cli.main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(bool(end.code))
    return CompletedProcess(arguments, code, out.getvalue(), errors.getvalue())
