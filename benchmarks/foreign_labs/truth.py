"""True effects of a data set, and the score of a verdict against them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Truth:
    """Hidden effects."""

    names: tuple = ()
    """Mechanisms that are there; all are to be named."""
    best: str = "nothing"
    """The best finding that the recordings allow, in words."""
    also: tuple = ()
    """Names that are as right, in place of `names`."""
    shows: bool = True
    """Whether the recordings can show it; if not, none is right too."""


def outcome(verdict, truth):
    """Return the score of a verdict, in words.

    right: exactly the truth is named, or nothing where nothing shows. in part: one of two is named, and nothing else.
    set with it, set without it: something is ambiguous, and the truth is, or is not, among all names listed.
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
