"""A fast model for the farm's tests."""

from functools import partial

import pytest
from farm_examples import HERE, label_episodes


@pytest.fixture
def solves(tmp_path, monkeypatch):
    """Make the fast model importable by workers; return a function that lists its solves as (process, x)."""
    log = tmp_path / "solves.log"
    monkeypatch.setenv("PYTHONPATH", str(HERE))
    monkeypatch.setenv("FAST_MODEL_LOG", str(log))
    return lambda: [tuple(line.split()) for line in log.read_text().splitlines()] if log.exists() else []


@pytest.fixture
def label_all(tmp_path, solves):
    """Return a function that labels episodes with the fast model in ``tmp_path`` and returns the summary."""
    return partial(label_episodes, tmp_path / "labels")
