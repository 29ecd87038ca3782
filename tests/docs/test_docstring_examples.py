"""The names that users touch first have examples in their docstrings; every example of a docstring runs as printed."""

import doctest
import importlib
from pathlib import Path

import example_folder
import pytest

import tacdata.warp_runtime  # noqa: F401 - starts Warp without its banner

ROOT = Path(__file__).resolve().parents[2]
FIRST = (
    "tacdata.sensor.default_sensor",
    "tacdata.sensor.read_sensor",
    "tacdata.sensor.Sensor",
    "tacdata.indenters.from_document",
    "tacdata.indenters.sphere.Sphere",
    "tacdata.plans.Plan",
    "tacdata.plans.Press",
    "tacdata.plans.shipped.shipped_plan.shipped_plan",
    "tacdata.rig.Registration",
    "tacdata.recording.read_session",
    "tacdata.recording.read_episode",
    "tacdata.recording.Episode",
    "tacdata.recording.check.report.check",
    "tacdata.importing.imported_session.import_session",
    "tacdata.wire.frames.decoder.Decoder",
    "tacdata.tags.detect_cube",
    "tacdata.demonstrations.compensation.compensate",
    "tacdata.transduction.Transducer",
    "tacdata.provenance.content_hash",
    "tacdata.labels.read_label",
    "tacdata.dataset.read_dataset",
    "tacdata.dataset.pack",
    "tacdata.dataset.windows.WindowDataset",
    "tacdata.effects.library",
    "tacdata.skin.press.PressRequest",
    "tacdata.discrepancy.model.spec.read_spec",
    "tacdata.training.metrics.depth_maps.score_frames",
    "tacdata.training.networks.network.create",
    "tacdata.viewers.source.scene_at",
    "tacdata.viewers.showing.show",
)
"""Thirty names, by where a user imports them from."""
PACKAGES = ("tacdata", "schemas", "label_farm", "training", "viewers")
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def module_name(path):
    name = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    return name if name.startswith("tacdata") else f"tacdata.{name}"


MODULES = sorted(
    module_name(path) for room in PACKAGES for path in (ROOT / room).rglob("*.py") if "    >>> " in path.read_text()
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder in which examples run: shipped ``examples``, a ``session`` of two presses, its ``dataset``."""
    made = tmp_path_factory.mktemp("examples")
    example_folder.fill(made)
    return made


@pytest.mark.parametrize("name", FIRST)
def test_a_name_that_users_touch_first_has_an_example(name):
    module, _, attribute = name.rpartition(".")
    value = getattr(importlib.import_module(module), attribute)
    assert doctest.DocTestParser().get_examples(value.__doc__), f"{name} has no example"


@pytest.mark.parametrize("name", MODULES)
def test_examples_run_as_printed(name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    module = importlib.import_module(name)
    runner, told = doctest.DocTestRunner(optionflags=FLAGS), []
    for test in doctest.DocTestFinder(exclude_empty=True).find(module, name, globs={}):
        runner.run(test, out=told.append)
    assert runner.tries > 0
    assert not runner.failures, "".join(told)
