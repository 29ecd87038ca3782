"""A value that a person has to give or to check."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Question:
    """An open question on a proposal."""

    text: str
    """A sentence."""
    topic: str = ""
    """Quantity that the answer decides: sign, unit, zero, contact, trials, clock, rate, date or specimen."""
    columns: tuple[str, ...] = ()
    """Columns that it concerns."""
    file: str = ""
    """Name under ``files`` of its columns; empty: the position's."""
    value: float | None = None
    """Number that is proposed."""
    word: str = ""
    """Layout or {part} that is proposed."""


def questions_of(texts: list[str] | tuple[str, ...]) -> tuple[Question, ...]:
    """Return sentences as questions without a topic."""
    return tuple(Question(text) for text in texts)
