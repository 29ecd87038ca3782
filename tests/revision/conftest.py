import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from revised_bench import record


@pytest.fixture(scope="session")
def late(tmp_path_factory):
    """Sixteen presses at two rates, readings 80 ms late."""
    return record(tmp_path_factory.mktemp("late") / "bench", late=0.08)


@pytest.fixture(scope="session")
def loose(tmp_path_factory):
    """Sixteen presses at one rate, drive with 0.06 mm of play."""
    return record(tmp_path_factory.mktemp("loose") / "bench", play=0.06, rates=(1.0,))
