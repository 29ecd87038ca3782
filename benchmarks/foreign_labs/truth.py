"""What is true of a data set, and how a verdict stands beside it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Truth:
    """What was hidden."""

    names: tuple = ()
    """Mechanisms that are there; all are to be named."""
    best: str = "nothing"
    """What the recordings can show at best, in words."""
    also: tuple = ()
    """Names that are as right, in place of `names`."""
    shows: bool = True
    """Whether the recordings can show it; if not, none is right too."""


def outcome(verdict, truth):
    """Return what came of a verdict, in words.

    right: exactly the truth is named, or nothing where nothing shows. in part: one of two is named, and nothing else
    told. set with it, set without it: something is ambiguous, and the truth is, or is not, among all that is told.
    unknown: with the truth suspected, or other things, or nothing. missed: none. wrong: a name that is not there.
    """
    names, right = set(truth.names), {*truth.names, *truth.also}
    status, effects = verdict["status"], verdict["effects"]
    told = {name for effect in effects for name in (effect["mechanism"], *effect["alternatives"])}
    if status == "unknown":
        return "unknown, truth suspected" if told & right else "unknown, other"
    named = {effect["mechanism"] for effect in effects if effect["status"] == "named"}
    if named - right:
        return "wrong"
    if status == "none":
        return "missed" if names and truth.shows else "right"
    if any(effect["status"] != "named" for effect in effects):
        return "set with it" if told & right else "set without it"
    return "right" if names <= named or named & set(truth.also) else "in part"
