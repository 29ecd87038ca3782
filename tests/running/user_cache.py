"""The user's cache, for all tests of a run one folder: what they keep lies apart from the user's.

The skin's small meshes lie in it from the beginning: fTetWild never gives the same one twice, and figures should not
scatter. One folder for every room: a second one that a room sets amid the run would take the meshes away. The cache
of Hugging Face lies there too: lerobot reads where it is once, when the first test imports it.
"""

import shutil
import uuid
from pathlib import Path

import pytest

MESHES = Path(__file__).parents[1] / "skin" / "mesh" / "meshes"


@pytest.fixture(scope="session", autouse=True)
def user_cache(tmp_path_factory):
    """The folder; processes that test side by side share it."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if base.name.startswith("popen-") else base) / "cache"
    made = tmp_path_factory.mktemp("cache")
    shutil.copytree(MESHES, made / "meshes")
    try:
        made.rename(folder)
    except OSError:
        shutil.rmtree(made)  # another process was first
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TACDATA_CACHE", str(folder))
        patch.setenv("HF_HOME", str(folder / "huggingface"))
        patch.setenv("HF_HUB_OFFLINE", "1")
        yield folder


@pytest.fixture(autouse=True)
def machine_states(tmp_path_factory, monkeypatch):
    """Keep where machines were left for each test alone."""
    base = tmp_path_factory.getbasetemp()
    monkeypatch.setenv("TACDATA_STATE", str(base / f"machines-{uuid.uuid4().hex}"))
