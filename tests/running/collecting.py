"""Collecting makes many objects that live as long as the process: looking through them for garbage finds none.

Every test process collects all tests, so this counts once a process. Afterwards the collector passes over what stands.
"""

import gc


def pytest_collection():
    """Look for no garbage while test files are imported."""
    gc.disable()


def pytest_collection_finish():
    """Look for garbage again, but not among what is there now."""
    gc.freeze()
    gc.enable()
