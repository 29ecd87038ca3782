"""The result of a labelling run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from tacdata.display import Displayed
from tacdata.label_farm.labels.margin import Margin


@dataclass(repr=False)
class LabellingSummary(Displayed):
    """Episodes written, current and failed in one run over a session."""

    written: list[int] = field(default_factory=list)
    """Episodes whose label was written."""
    current: list[int] = field(default_factory=list)
    """Episodes whose label lay there already."""
    failed: dict[int, str] = field(default_factory=dict)
    """Episode -> reason why it has no label."""
    untouched: int = 0
    """Labels without contact, which need no solve."""
    seconds: list[float] = field(default_factory=list)
    """Time of each path solved in this run [s]."""
    found: int = 0
    """Paths that the store held already."""
    margins: list[Margin] = field(default_factory=list)
    """How well each written label with contact is known."""
    remarks: list[str] = field(default_factory=list)
    """Remarks on the models for the user."""

    def description(self) -> Iterator[str]:
        """Yield the numbers of labels, and the first reason of a failure."""
        yield f"Labels: {len(self.written)} written, {len(self.current)} current before, {len(self.failed)} failed"
        for number, reason in list(self.failed.items())[:1]:
            yield f"episode {number}: {reason.splitlines()[0]}"
        yield from self.remarks
