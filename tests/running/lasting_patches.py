"""The patch that outlives its test: a module imported meanwhile keeps the replaced name."""

import sys

import pytest


@pytest.fixture
def monkeypatch():
    """Patches of one test, as pytest's own; the test fails if a module that it imported first keeps one of them."""
    loaded = set(sys.modules)
    with pytest.MonkeyPatch.context() as patches:
        yield patches
        values = list(_values(patches))
    identities = set(map(id, values))
    kept = [
        f"{module}.{name}"
        for module in set(sys.modules) - loaded
        if module.startswith("tacdata")
        for name, value in vars(sys.modules[module]).items()
        if id(value) in identities
    ]
    assert not kept, f"{kept} keep a patched value for all later tests: patch the name where it is read"


def _values(patches: pytest.MonkeyPatch):
    """Yield the values that replace others now; without plain constants, which are equal by chance."""
    for target, name, _ in patches._setattr:
        value = getattr(target, name, None)
        if callable(value):
            yield value
