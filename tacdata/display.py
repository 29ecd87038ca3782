"""How a noun shows itself: at most six lines of text, a picture, and both in a notebook.

The pictures are a registry, ``viewers/portraits``: one file for each class, named after it. So a room can offer
``plot`` and import no viewer.
"""

from __future__ import annotations

import html
import io
import re
from base64 import b64encode
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tacdata import registry
from tacdata.errors import TacdataError, UsageError
from tacdata.paths import StrPath

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOM, BASE = "tacdata.viewers.portraits", "portrait"
LINES = 6
"""Most lines of a description."""
RESOLUTION = 72
"""Of pictures in a notebook [dots per inch]."""


class Displayed:
    """A noun that describes itself and draws itself."""

    def description(self) -> Iterable[str]:
        """Return the lines that describe the noun, the first with its class."""
        return [type(self).__name__]

    def __repr__(self) -> str:
        """Return the description, at most `LINES` lines."""
        return "\n  ".join([*self.description()][:LINES])

    def plot(self, path: StrPath | None = None) -> Figure:
        """Return a picture of the noun, and save it if a path is given.

        Args:
            path: New file; its ending decides the format: .png, .pdf or .svg.

        Raises:
            UsageError: If the file exists, or no picture of this class is known.
        """
        portrait = _portrait(type(self))
        if portrait is None:
            drawable = ", ".join(registry.names(ROOM, BASE))
            raise UsageError(f"no picture of a {type(self).__name__}", drawable, "plot one of them, or its parts")
        figure = portrait(self)
        if path is not None:
            if Path(path).exists():
                raise UsageError(f"{path} exists", "a new file; nothing is overwritten", "choose another name")
            figure.savefig(path, dpi=100)
        return figure

    def _repr_html_(self) -> str:
        """Return the description and the picture, for notebooks; the description alone where nothing can be drawn."""
        text = f"<pre>{html.escape(repr(self))}</pre>"
        if _portrait(type(self)) is None:
            return text
        try:
            figure = self.plot()
        except (TacdataError, ImportError) as error:
            return f"{text}<pre>no picture: {html.escape(str(error).splitlines()[0])}</pre>"
        stream = io.BytesIO()
        # Into the page itself: a notebook that is sent by mail keeps its pictures.
        figure.savefig(stream, format="png", dpi=RESOLUTION)
        return f'{text}<img style="max-width:100%" src="data:image/png;base64,{b64encode(stream.getvalue()).decode()}">'


def _portrait(kind: type) -> Callable[[Any], Figure] | None:
    """Return the function that draws a class, or the nearest class that it is derived from; None without one."""
    for each in kind.__mro__:
        # A class `PathSolution` is drawn by `path_solution.py`.
        name = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", each.__name__).lower()
        if registry.has(ROOM, BASE, name):
            return registry.load_module(ROOM, BASE, name).portrait
    return None
