"""The data engine for soft tactile skins, as a library: ``import tacdata as td``.

Importing it loads nothing else: each name is imported when it is first used.

**Open.** `open` takes any path. `read_session`, `read_episode`, `read_label`, `read_dataset`, `read_network`,
`read_verdict`, `read_sensor` and `read_plan` each expect one kind. `example_session` copies two presses that ship.

**Nouns.** `Session` (iterate over its episodes, or ``session[3]``), `Episode` (``readings``, ``tared``, ``times``,
``depth``, ``label``, ``to_pandas()``), `Label` (``depth``, ``force``, ``error``), `Dataset` (columns by name,
``windows()`` for torch), `Network` (``predict(episode)``), `Verdict` (``status``, ``effects``, ``text``), `Sensor`,
`Plan`, `Press`, `Skin` (``solve(press)``), `Solution`. Recorded and computed ones describe themselves in at most six
lines, draw themselves by ``plot()``, and show both in a notebook.

**Steps of the pipeline.** `check`, `label`, `pack`, `train`, `evaluate`, `import_files`, `simulate`, `judge`: the verbs
of the command line call the same functions. ``indenter("sphere", radius=4.0)`` gives a shape to press with.
`add_plugins` adds a folder of your own drivers, indenters, materials, effects, networks or viewers.

**Errors.** Bad input raises a `TacdataError`: `UsageError`, `FormatError`, `SolveError`, `DeviceError`, `PackageError`.

Example:
    >>> import tacdata as td
    >>> session = td.example_session("first look")
    >>> episode = session[1]
    >>> print(episode.press)
    flat_punch (radius 1.5, edge radius 0.3) at x -2.85, y 3.75 mm, 0.98 mm deep
    >>> network = td.read_network("shipped")
    >>> network.predict(episode).depth.shape
    (225, 35, 26)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tacdata.dataset.reader import Dataset, read_dataset
    from tacdata.discrepancy.verdict_folder import VerdictFolder as Verdict
    from tacdata.discrepancy.verdict_folder import read_verdict
    from tacdata.errors import DeviceError, FormatError, PackageError, SolveError, TacdataError, UsageError
    from tacdata.labels.label import Label
    from tacdata.labels.label import PathSolution as Solution
    from tacdata.labels.table import read as read_label
    from tacdata.pipeline.check import check
    from tacdata.pipeline.evaluate import evaluate
    from tacdata.pipeline.example_session import example_session
    from tacdata.pipeline.import_files import import_files
    from tacdata.pipeline.judge import judge
    from tacdata.pipeline.label import label
    from tacdata.pipeline.open import open
    from tacdata.pipeline.pack import pack
    from tacdata.pipeline.simulate import simulate
    from tacdata.pipeline.skin_press import SolvableSkin as Skin
    from tacdata.pipeline.skin_press import indenter
    from tacdata.pipeline.train import train
    from tacdata.pipeline.trained_network import TrainedNetwork as Network
    from tacdata.pipeline.trained_network import read_network
    from tacdata.plans.plan import Plan, Press, read_plan
    from tacdata.recording.episode import Episode
    from tacdata.recording.files.reader import read_episode
    from tacdata.recording.session import Session, read_session
    from tacdata.registry import add_folder as add_plugins
    from tacdata.sensor.sensor import Sensor, read_sensor

    __version__: str

_HOMES = {
    "tacdata.dataset.reader": ("Dataset", "read_dataset"),
    "tacdata.errors": ("DeviceError", "FormatError", "PackageError", "SolveError", "TacdataError", "UsageError"),
    "tacdata.labels.label": ("Label", "Solution=PathSolution"),
    "tacdata.labels.table": ("read_label=read",),
    "tacdata.pipeline.check": ("check",),
    "tacdata.pipeline.evaluate": ("evaluate",),
    "tacdata.pipeline.example_session": ("example_session",),
    "tacdata.pipeline.import_files": ("import_files",),
    "tacdata.pipeline.judge": ("judge",),
    "tacdata.pipeline.label": ("label",),
    "tacdata.pipeline.open": ("open",),
    "tacdata.pipeline.pack": ("pack",),
    "tacdata.pipeline.simulate": ("simulate",),
    "tacdata.pipeline.skin_press": ("Skin=SolvableSkin", "indenter"),
    "tacdata.pipeline.train": ("train",),
    "tacdata.pipeline.trained_network": ("Network=TrainedNetwork", "read_network"),
    "tacdata.discrepancy.verdict_folder": ("Verdict=VerdictFolder", "read_verdict"),
    "tacdata.plans.plan": ("Plan", "Press", "read_plan"),
    "tacdata.recording.episode": ("Episode",),
    "tacdata.recording.files.reader": ("read_episode",),
    "tacdata.recording.session": ("Session", "read_session"),
    "tacdata.registry": ("add_plugins=add_folder",),
    "tacdata.sensor.sensor": ("Sensor", "read_sensor"),
}
"""Module -> the public names that it holds; ``Public=Name`` where the public name is another one."""
_NAMES = {
    public: (module, name or public)
    for module, entries in _HOMES.items()
    for public, _, name in (entry.partition("=") for entry in entries)
}

__all__ = ["__version__", *_NAMES]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used.

    Raises:
        AttributeError: If there is no such name.
    """
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("tacdata")
    elif name in _NAMES:
        module, attribute = _NAMES[name]
        value = getattr(import_module(module), attribute)
    else:
        raise AttributeError(f"module 'tacdata' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names; nothing is imported."""
    return sorted(__all__)
