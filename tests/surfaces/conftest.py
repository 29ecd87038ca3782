"""Surfaces that tests read are kept apart from the user's."""

import pytest


@pytest.fixture(scope="session", autouse=True)
def shapes_folder(tmp_path_factory):
    """A cache of the test run."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("cache")
        patch.setenv("TACDATA_CACHE", str(folder))
        yield folder
