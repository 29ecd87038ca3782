"""Scripts of benchmarks import one another by bare names: none may outlast the tests of its benchmark."""

import os
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module", autouse=True)
def _scripts_of_one_benchmark():
    """Restore path, working folder and environment; forget modules that came from a benchmark's folder."""
    path, folder, environment, modules = list(sys.path), os.getcwd(), dict(os.environ), set(sys.modules)
    yield
    sys.path[:] = path
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    for name in set(sys.modules) - modules:
        if str(getattr(sys.modules[name], "__file__", None) or "").startswith(str(BENCHMARKS)):
            del sys.modules[name]
