"""Every example runs as it stands, and the README lists it."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "examples"
EXAMPLES = sorted(FOLDER.glob("*.py"))
JUDGED = pytest.mark.long(
    "examples/hidden_delay.py",
    "tacdata/commands/import.py",
    "tacdata/commands/discrepancy.py",
    reason="a verdict among all effects",
)
TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorial" / "README.md"
RUN = [pytest.param(path, marks=JUDGED) if path.stem == "hidden_delay" else path for path in EXAMPLES]


@pytest.mark.parametrize("path", RUN, ids=lambda p: p.stem)
def test_an_example_runs(path, tmp_path):
    done = subprocess.run([sys.executable, str(path)], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    if path.stem == "hidden_delay":
        shown = re.search(r"^NAMED:.*?(?=^```)", TUTORIAL.read_text(), re.M | re.S)[0]
        assert not _without_numbers(shown) - _without_numbers(done.stdout), "copy today's output into the tutorial"
        (delay, error), (found, _) = (
            re.search(r"L = (\S+) \+- (\S+) s", text).groups() for text in (shown, done.stdout)
        )
        assert float(found) == pytest.approx(float(delay), abs=float(error))
        assert float(delay) == pytest.approx(0.08, abs=2 * float(error)), "the rig's"


def _without_numbers(text):
    """Return the lines of an output without what may differ from one computer to another."""
    return {re.sub(r"\d[\d.e-]*", "#", line) for line in text.splitlines()}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_an_example_is_short_and_listed(path):
    assert len(path.read_text().splitlines()) <= 60
    assert f"`{path.name}`" in (FOLDER / "README.md").read_text()
