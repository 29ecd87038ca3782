"""A fast model for the farm's tests."""

from functools import partial

import pytest
from farm_examples import HERE, label_episodes
from one_process import OneProcess, version

from tacdata.label_farm.presses import model


@pytest.fixture
def solves(tmp_path, monkeypatch):
    """Make the fast model importable by workers; return a function that lists its solves as (process, x)."""
    log = tmp_path / "solves.log"
    monkeypatch.setenv("PYTHONPATH", str(HERE))
    monkeypatch.setenv("FAST_MODEL_LOG", str(log))
    return lambda: [tuple(line.split()) for line in log.read_text().splitlines()] if log.exists() else []


@pytest.fixture
def quick_version(monkeypatch):
    """The version of a model is found in this process."""
    monkeypatch.setattr(model, "version", version)


@pytest.fixture
def label_all(tmp_path, solves, quick_version):
    """Return a function that labels episodes with the fast model in ``tmp_path`` and returns the summary."""
    return partial(label_episodes, tmp_path / "labels", engine=OneProcess)


@pytest.fixture
def label_by_workers(tmp_path, solves, quick_version):
    """Return a function as `label_all`, whose workers are processes, as a user's are."""
    return partial(label_episodes, tmp_path / "labels")
