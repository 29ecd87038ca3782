"""Memory maps of the tests' datasets lie in a folder of their own."""

import pytest


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch):
    folder = tmp_path_factory.mktemp("cache")
    monkeypatch.setenv("TACDATA_CACHE", str(folder))
    return folder
