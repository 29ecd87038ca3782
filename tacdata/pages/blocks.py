"""Blocks of words: paragraphs, lists, large figures, shares, pictures."""

import base64
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from typing import BinaryIO, ClassVar


@dataclass(frozen=True)
class Paragraph:
    """A paragraph. Words in backquotes are set as code; a command can be copied."""

    words: str
    note: bool = False
    """Whether it is set small."""
    kind: ClassVar[str] = "paragraph"


@dataclass(frozen=True)
class Items:
    """A list, one sentence an item."""

    lines: Sequence[str]
    note: bool = False
    """Whether it is set small."""
    kind: ClassVar[str] = "items"


@dataclass(frozen=True)
class Commands:
    """Commands, each in a line of its own with a button that copies it."""

    lines: Sequence[str]
    kind: ClassVar[str] = "commands"


@dataclass(frozen=True)
class Tiles:
    """Values in large print, each with its name."""

    tiles: Sequence[tuple[str, str]]
    """Value and name."""
    kind: ClassVar[str] = "tiles"


@dataclass(frozen=True)
class Shares:
    """One bar of shares."""

    parts: Sequence[tuple[str, float]]
    """Name and share [1]."""
    rest: str = ""
    """Name of the part that is set grey."""
    kind: ClassVar[str] = "shares"

    @property
    def widths(self) -> list[tuple[str, float, float]]:
        """Name, share [%] and width of the bar [%] of each part."""
        # Shares that do not add up to 1, as of overlapping parts, still fill the bar.
        total = max(sum(share for _, share in self.parts), 1e-12)
        return [(name, 100 * share, 100 * share / total) for name, share in self.parts]


@dataclass(frozen=True)
class Prose:
    """Markdown; its headings are set one level lower."""

    markdown: str
    kind: ClassVar[str] = "prose"

    @property
    def html(self) -> str:
        """The text as HTML."""
        from markdown_it import MarkdownIt

        converter = MarkdownIt("js-default")
        tokens = converter.parse(self.markdown)
        for token in tokens:
            if token.type.startswith("heading"):
                token.tag = f"h{min(int(token.tag[1:]) + 1, 6)}"
        return converter.renderer.render(tokens, converter.options, {})


@dataclass(frozen=True)
class Picture:
    """A PNG inside the page."""

    draw: Callable[[BinaryIO], object]
    """Writes the PNG to a stream."""
    words: str
    """Caption."""
    kind: ClassVar[str] = "picture"
    _drawn: BytesIO = field(default_factory=BytesIO, init=False, repr=False, compare=False)

    @property
    def data(self) -> str:
        """The file in base 64."""
        # Drawn when the page is written, and once: a page may be asked for its text several times.
        if not self._drawn.tell():
            self.draw(self._drawn)
        return base64.b64encode(self._drawn.getvalue()).decode("ascii")
