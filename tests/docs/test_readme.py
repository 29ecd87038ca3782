"""The first command of the README prints what the README shows."""

import re
import subprocess
import sys
from pathlib import Path

README = (Path(__file__).resolve().parents[2] / "README.md").read_text()


def test_the_first_command_prints_what_is_shown(tmp_path):
    shown = re.search(r"^tacdata (example)\n```\n\n```\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
    assert shown, "tacdata example with its output"
    done = subprocess.run(
        [sys.executable, "-m", "tacdata.cli", shown[1]], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout == shown[2]
    assert (tmp_path / "example" / "press.png").stat().st_size > 50_000
