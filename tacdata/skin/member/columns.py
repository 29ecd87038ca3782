"""Data of a batch: dataclasses whose tensors have one batch member a column."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields
from typing import Any, Self

import torch

Map = Callable[[torch.Tensor], torch.Tensor]


class Columns:
    """Base of dataclasses of tensors whose last axis runs over the members of a batch.

    A field is a tensor, another `Columns`, a tuple of these, or None. Members are chosen by index, shape (k,), int64,
    or by mask, shape (b,), bool.

    >>> import torch
    >>> from tacdata.skin.member.pose import Pose
    >>> poses = Pose(torch.zeros(3, 4), torch.zeros(3, 3, 4))
    >>> one = poses.take(torch.tensor([2]))
    >>> one.place.shape
    torch.Size([3, 1])
    >>> poses.put(torch.tensor([0]), Pose(torch.ones(3, 1), torch.zeros(3, 3, 1)))
    >>> poses.place[0]
    tensor([1., 0., 0., 0.])
    """

    def take(self, which: torch.Tensor) -> Self:
        """Return a copy of some members, by index."""
        return _mapped(self, lambda mine: mine.index_select(-1, which))

    def take_into(self, source: Self, which: torch.Tensor) -> None:
        """Copy members of ``source``, by index, into the tensors that this one has: their addresses stay."""
        for target, theirs in _pairs(self, source):
            torch.index_select(theirs, -1, which, out=target)

    def put(self, which: torch.Tensor, source: Self) -> None:
        """Replace some members, by index, by those of ``source``."""
        for target, theirs in _pairs(self, source):
            target.index_copy_(-1, which, theirs)

    def put_where(self, mask: torch.Tensor, source: Self) -> None:
        """Replace the members in ``mask`` by those of ``source``, which has as many columns."""
        for target, theirs in _pairs(self, source):
            target.copy_(torch.where(mask, theirs, target))

    def copy(self) -> Self:
        """Return a copy that shares no memory."""
        return _mapped(self, torch.clone)

    def repeat(self, count: int) -> Self:
        """Return ``count`` equal members made of a single one."""
        return _mapped(self, lambda mine: mine.repeat(*[1] * (mine.dim() - 1), count))

    def zeros(self) -> Self:
        """Return zeros of the same shapes."""
        return _mapped(self, torch.zeros_like)

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the members of several, one after another."""
        return _joined(list(parts))


def _mapped(value: Any, change: Map) -> Any:
    if isinstance(value, torch.Tensor):
        return change(value)
    if isinstance(value, tuple):
        return tuple(_mapped(part, change) for part in value)
    if isinstance(value, Columns):
        return type(value)(*(_mapped(part, change) for part in _parts(value)))
    return value


def _joined(values: list[Any]) -> Any:
    first = values[0]
    if isinstance(first, torch.Tensor):
        return torch.cat(values, dim=-1)
    if isinstance(first, tuple):
        return tuple(_joined(list(parts)) for parts in zip(*values, strict=True))
    if isinstance(first, Columns):
        return type(first)(*(_joined(list(parts)) for parts in zip(*map(_parts, values), strict=True)))
    return first


def _pairs(target: Any, theirs: Any) -> Iterator[tuple[torch.Tensor, torch.Tensor]]:
    if isinstance(target, torch.Tensor):
        yield target, theirs
    elif isinstance(target, tuple):
        for field, counterpart in zip(target, theirs, strict=True):
            yield from _pairs(field, counterpart)
    elif isinstance(target, Columns):
        yield from _pairs(tuple(_parts(target)), tuple(_parts(theirs)))


def _parts(value: Any) -> Iterator[Any]:
    return (getattr(value, field.name) for field in fields(value))
