"""One verdict beside one truth, in a word."""

import itertools

from worlds.physics import KNOWN

RIGHT = ("right none", "success", "set, as it should", "unknown, as it should")
WRONG = ("false name", "wrong name", "overclaim")
"""Confidently wrong."""


def accepted(name):
    """Return the names that a verdict may rightly give to what is hidden."""
    return set(KNOWN[name].called)


def fits(truths, sets):
    """Return whether every truth can be given a set of its own that holds one of its names, and none is left over."""
    if len(truths) != len(sets):
        return False
    return any(
        all(accepted(t) & s for t, s in zip(order, sets, strict=True)) for order in itertools.permutations(truths)
    )


def outcome(truth, verdict):
    """Return what came of one world.

    Args:
        truth: As in OUT/truth/ID.json.
        verdict: As in OUT/verdicts/LABEL/ID.json; None if the judge crashed.
    """
    if verdict is None:
        return "crashed"
    status, members, hidden = verdict["status"], verdict["effects"], list(truth["effects"])
    certain = [{m["mechanism"]} for m in members if m["status"] == "named"]
    whole = [{m["mechanism"], *m["alternatives"]} for m in members]
    expected = truth["expected"]
    if expected == "none":
        if status == "none":
            return "right none"
        return "false name" if status.startswith("named") and certain else "false alarm without a name"
    if status == "none":
        return "missed"
    if expected == "part" or status == "named, incomplete":
        wrong = any(not any(c <= accepted(h) for h in hidden) for c in certain)
        if wrong or not certain:
            return "wrong name" if wrong else "unknown"
        return "overclaim" if expected == "set" else "success" if expected == "part" else "set with the truth"
    if status == "named":
        if expected == "set":
            return "overclaim"
        return "success" if expected == "name" and fits(hidden, certain) else "wrong name"
    if status == "unknown":
        return "unknown, as it should" if expected == "unknown" else "unknown"
    if any(not any(c <= accepted(h) for h in hidden) for c in certain):
        return "wrong name"  # one of several is said to be certain and is not there
    if expected == "unknown":
        return "unknown, as it should"
    if expected == "set" and certain:
        return "overclaim"
    if fits(hidden, whole):
        return "set, as it should" if expected == "set" else "set with the truth"
    if all(any(accepted(h) & s for s in whole) for h in hidden):
        return "set with the truth and more"
    return "set without the truth"


def found(truth, verdict, name):
    """Return whether one of several hidden things is among the answer: named, in a set, or no."""
    if verdict is None:
        return "no"
    if any(m["mechanism"] in accepted(name) and m["status"] == "named" for m in verdict["effects"]):
        return "named"
    return (
        "in a set" if any(accepted(name) & {m["mechanism"], *m["alternatives"]} for m in verdict["effects"]) else "no"
    )
