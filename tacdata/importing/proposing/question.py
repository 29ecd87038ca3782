"""A value that a person has to give or to check."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Question:
    """An open question on a proposal."""

    text: str
    """A sentence."""
    topic: str = ""
    """Quantity that the answer decides: sign, unit, zero, contact, trials, rate, date or specimen; empty: another."""
    columns: tuple[str, ...] = ()
    """Columns of the position that it concerns."""
    file: str = ""
    """Name under ``files`` that it concerns."""
    value: float | None = None
    """Number that is proposed."""
    word: str = ""
    """Layout or {part} that is proposed."""


def questions_of(texts: list[str] | tuple[str, ...]) -> tuple[Question, ...]:
    """Return sentences as questions without a topic."""
    return tuple(Question(text) for text in texts)
