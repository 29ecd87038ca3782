"""A page: header, sections, and everything that it needs inside."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from html import escape
from importlib.resources import files
from typing import Any

LISTED = 5
"""Sections from which a page has a list of its contents."""
PLOTS = {"plot", "slider", "map"}


@dataclass(frozen=True)
class PageHeader:
    """The head of every page."""

    what: str
    """Kind of the page, for example "Verdict"."""
    sentence: str
    """What the page says, in one sentence."""
    of: str = ""
    """Session, dataset or unit."""
    made: str = ""
    """Date."""
    version: str = ""
    """Version of tacdata."""
    status: str = ""
    """One word."""
    tone: str = ""
    """Colour of the status: good, bad or neither."""
    lines: Sequence[str] = ()
    """Sentences below the first, for example a size with its interval."""
    next: Sequence[str] = ()
    """What to do next, commands in backquotes, filled in."""

    @property
    def origin(self) -> list[str]:
        """What, of which session or unit, when, and which version."""
        version = f"tacdata {self.version}" if self.version else ""
        return [words for words in (self.what, self.of, self.made, version) if words]


@dataclass(frozen=True)
class Section:
    """A titled part of a page."""

    title: str
    blocks: Sequence[Any] = ()
    """Blocks of `tacdata.pages`, in their order. Figures that follow each other are set side by side."""
    folded: bool = False
    """Whether it opens on a click."""

    @property
    def rows(self) -> list[list[Any]]:
        """The blocks: figures that follow each other in one row, each other block by itself."""
        rows: list[list[Any]] = []
        for block in self.blocks:
            # Only figures of one kind: a plot and a map have different heights.
            if rows and block.kind in ("plot", "map") and rows[-1][-1].kind == block.kind:
                rows[-1].append(block)
            else:
                rows.append([block])
        return rows


@dataclass
class HtmlPage:
    """A page that grows from top to bottom; `text` is the finished file."""

    header: PageHeader
    sections: list[Section] = field(default_factory=list)

    def add(self, title: str, *blocks: Any, folded: bool = False) -> None:
        """Add a section; none without blocks."""
        if present := [block for block in blocks if block is not None]:
            self.sections.append(Section(title, present, folded))

    @property
    def text(self) -> str:
        """The file."""
        # A page without figures goes without the plotting script, which is most of its size.
        drawn = any(block.kind in PLOTS for section in self.sections for block in section.blocks)
        listed = len(self.sections) >= LISTED
        return _template().render(
            head=self.header, sections=self.sections, listed=listed, style=_read("style.css"), script=_script(drawn)
        )


def live_page(title: str, body: str) -> str:
    """Return a page that a server fills: its body within the style of the others.

    Args:
        title: Title of the window.
        body: Elements of the page and its script, as HTML. Its script finds the kit's under `tacdata`.
    """
    return _template("live.html.j2").render(
        title=title, body=body, style=_read("style.css"), script=_script(drawn=True)
    )


@cache
def _read(name: str) -> str:
    return (files("tacdata.pages") / name).read_text(encoding="utf-8")


def _script(drawn: bool) -> str:
    names = ("uplot/uPlot.iife.min.js", "page.js", "figures.js") if drawn else ("page.js",)
    return "\n".join(_read(name) for name in names)


@cache
def _template(name: str = "page.html.j2") -> Any:
    from jinja2 import Environment, PackageLoader

    def coded(words: object) -> str:
        """Words in backquotes as code; those that begin with the command's name can be copied."""
        pieces = []
        for number, piece in enumerate(str(words).split("`")):
            command = ' class="command"' if piece.startswith("tacdata ") else ""
            pieces.append(f"<code{command}>{escape(piece)}</code>" if number % 2 else escape(piece))
        return "".join(pieces)

    # Words come from files of users: everything is escaped unless a filter has done so.
    environment = Environment(
        loader=PackageLoader("tacdata.pages", "."), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["coded"] = coded
    return environment.get_template(name)
