"""The content of a verb's file. Copy this shape; no other file needs to change.

A module in this folder named ``my_verb.py`` becomes ``tacdata my-verb``. It holds

- ``PANEL``: one of `TASKS`, its heading in ``tacdata --help``;
- ``ORDER``: its place under the heading, in the order in which a person meets the verbs;
- ``EXAMPLES``: three command lines that ``--help`` shows;
- ``run(...)``: a Typer command. ``--help`` shows the first line of its docstring. Heavy imports stay inside it.
  Bad input raises a `tacdata.errors.TacdataError`; the command line prints it and exits with its code.

A verb that finds something out prints it and returns it as a `Result`. The command line then gives it ``--json``. Every
verb has ``--quiet``: it prints results with ``print``, progress and the next command with `tacdata.progress.say`.

A verb joins rooms and prints; if it grows logic, a room is missing a function.
"""

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, is_dataclass
from pathlib import PurePath
from types import ModuleType
from typing import Any

from tacdata import registry
from tacdata.errors import Exit, TacdataError

START = "Start"
RECORD = "Record: rig, plan, recordings"
DATA = "Data: import, look, label, pack"
LEARN = "Learn: train and score networks"
FIND = "Find the missing physical effect"
HANDS = "Hands and robots"
FARM = "Label farm"
TASKS = (START, RECORD, DATA, LEARN, FIND, HANDS, FARM)
"""Headings of ``tacdata --help``, in the order in which a person meets them."""


@dataclass(frozen=True)
class Result:
    """Result of a verb, for ``--json``, and how it ends."""

    document: Any
    """Dictionaries, lists, numbers, texts, paths, arrays and dataclasses."""
    ends: Exit | TacdataError = Exit.DONE
    """The exit code, or the error that is printed and gives it."""

    @property
    def text(self) -> str:
        """The document as JSON."""
        return json.dumps(plain(self.document), indent=1, ensure_ascii=False, allow_nan=False)


def members(room: str, base: str) -> list[tuple[ModuleType, str]]:
    """Return a room's verbs and their names as they are typed, by task and in their order.

    Args:
        room: Dotted package name, such as ``tacdata.commands``.
        base: File name of the room's base, which is no verb.
    """
    modules = [registry.load_module(room, base, name) for name in registry.names(room, base)]
    ranks = {panel: rank for rank, panel in enumerate(TASKS)}
    modules.sort(key=lambda module: (ranks.get(getattr(module, "PANEL", ""), len(ranks)), module.ORDER))
    return [(module, module.__name__.rsplit(".", 1)[-1].replace("_", "-")) for module in modules]


def agreed(question: str) -> bool:
    """Ask on the terminal and return whether the answer is yes; no answer (the input is closed) is a no."""
    try:
        return input(question).strip().lower() in ("y", "yes")
    except EOFError:
        print()
        return False


@contextmanager
def before_it_moves() -> Iterator[None]:
    """Let a Ctrl-C say that nothing was moved yet."""
    try:
        yield
    except KeyboardInterrupt as error:
        error.add_note("  motion: nothing was moved\n  data:   nothing was written\n  then:   the same command")
        raise


def plain(value: Any) -> Any:
    """Return a value in JSON's types: arrays as lists, values that are not finite as null."""
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item) for item in value]
    if isinstance(value, PurePath):
        return str(value)
    if lists := getattr(value, "tolist", None):  # a numpy array or number
        return plain(lists())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
