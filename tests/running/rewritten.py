"""Writes what pytest makes of the tests' assertions, before the test processes start.

They start at the same time: from a clean clone each would rewrite all files, seconds of the processor a process.
Pytest offers no command for it, so these are functions of its own; a test holds that it finds what they write.
"""

from pathlib import Path
from types import SimpleNamespace

from _pytest.assertion import rewrite

TESTS = Path(__file__).parents[1]
PLUGINS = TESTS / "running"
"""Plugins are rewritten like tests."""


def main():
    """Write for every file that pytest would rewrite."""
    for path in (*TESTS.rglob("test_*.py"), *TESTS.rglob("conftest.py"), *PLUGINS.glob("*.py")):
        write(path)


def place(path):
    """Return where pytest keeps what it made of a file."""
    return rewrite.get_cache_dir(path) / (path.stem + rewrite.PYC_TAIL)


def write(path):
    """Write what pytest makes of a file, unless it is there already."""
    if rewrite._read_pyc(path, place(path)) is None:
        source, code = rewrite._rewrite_test(path, None)
        rewrite.try_makedirs(place(path).parent)
        rewrite._write_pyc(SimpleNamespace(trace=print), code, source, place(path))


if __name__ == "__main__":
    main()
