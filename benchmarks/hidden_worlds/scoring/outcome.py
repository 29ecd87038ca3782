"""Outcome of one verdict against one truth, in a word."""

import itertools

from worlds.physics import KNOWN

from tacdata.effects import load

RIGHT = ("right none", "success", "set, as it should", "unknown, as it should")
WRONG = ("false name", "wrong name", "wrong family", "overclaim")
"""Confidently wrong."""
FAMILIES = {
    "cable_pull": ("gain and offset in time",),
    "stick_slip": ("friction and play",),
    "ageing_creep": ("memory of the skin",),
    "lost_and_found": ("kinematics",),
    "tag_flex": ("kinematics",),
    "moisture_front": ("gain and offset in time",),
    "scan_order_change": ("delay and filtering",),
    "warm_creep": ("memory of the skin",),
    "loose_tool": ("kinematics", "contact"),
    "rocking": ("kinematics", "contact"),
}
"""Effect outside every library -> the families that are right for it, by where its law acts; no other has one."""


def accepted(name):
    """Return the names that a verdict may rightly give to a hidden effect."""
    return set(KNOWN[name].called)


def families(name):
    """Return the families that a verdict may rightly give to a hidden effect."""
    return {load(called).family.value for called in KNOWN[name].called} | set(FAMILIES.get(name, ()))


def claims(verdict):
    """Return the certain claims of a verdict: each effect's mechanism and its family, one of them None.

    At the level of a family nothing is claimed of the mechanism that fits best in it.
    """
    made = []
    for m in verdict["effects"]:
        if m.get("level") == "family" and m["status"] in ("named", "ambiguous"):
            made.append((None, m["family"]))
        elif m["status"] == "named":
            made.append((m["mechanism"], None))
    return made


def holds(claim, name):
    """Return whether a claim is true of a hidden effect."""
    mechanism, family = claim
    return family in families(name) if mechanism is None else mechanism in accepted(name)


def fits(truths, sets):
    """Return whether every truth can be given a set of its own that holds one of its names, and none is left over."""
    if len(truths) != len(sets):
        return False
    return any(
        all(accepted(t) & s for t, s in zip(order, sets, strict=True)) for order in itertools.permutations(truths)
    )


def overclaims(claim, truth):
    """Return whether a claim about an alias exceeds an oracle's: a name, or a family its rival is not of."""
    mechanism, family = claim
    rival = truth.get("facts", {}).get("rival")
    return mechanism is not None or (rival is not None and family not in families(rival))


def family_right(truth, verdict):
    """Return whether every hidden thing is claimed, at least by its family, and nothing else is."""
    if verdict is None or not verdict["effects"]:
        return False
    claimed = [(m, f or load(m).family.value) for m, f in claims(verdict)]
    true = all(any(f in families(h) for h in truth["effects"]) for _, f in claimed)
    return true and all(any(f in families(h) for _, f in claimed) for h in truth["effects"])


def outcome(truth, verdict):
    """Return the outcome of one world.

    Args:
        truth: As in OUT/truth/ID.json.
        verdict: As in OUT/verdicts/LABEL/ID.json; None if the judge crashed.
    """
    if verdict is None:
        return "crashed"
    status, members, hidden = verdict["status"], verdict["effects"], list(truth["effects"])
    certain, expected = claims(verdict), truth["expected"]
    whole = [{m["mechanism"], *m["alternatives"]} for m in members]
    if expected == "none":
        if status == "none":
            return "right none"
        return "false name" if status.startswith("named") and certain else "false alarm without a name"
    if status == "none":
        return "missed"
    if status == "unknown":
        return "unknown, as it should" if expected == "unknown" else "unknown"
    if false := [c for c in certain if not any(holds(c, h) for h in hidden)]:
        return "wrong family" if all(mechanism is None for mechanism, _ in false) else "wrong name"
    if expected == "set" and any(overclaims(c, truth) for c in certain):
        return "overclaim"
    if expected == "unknown":
        return "unknown, as it should"  # the claim is a family, and it is right
    if status == "named" and expected != "part":
        return "success" if fits(hidden, [{m} for m, _ in certain]) else "wrong name"
    if expected == "part" or status == "named, incomplete":
        if not certain:
            return "unknown"
        if all(mechanism is None for mechanism, _ in certain):
            return "set, as it should" if expected == "set" else "right family"
        return "success" if expected == "part" else "set with the truth"
    if fits(hidden, whole):
        return "set, as it should" if expected == "set" else "set with the truth"
    if all(any(accepted(h) & s for s in whole) for h in hidden):
        return "set with the truth and more"
    return "right family" if family_right(truth, verdict) else "set without the truth"


def found(truth, verdict, name):
    """Return whether one of several hidden things is among the answer: named, in a set, or no."""
    if verdict is None:
        return "no"
    if any(mechanism in accepted(name) for mechanism, _ in claims(verdict)):
        return "named"
    return (
        "in a set" if any(accepted(name) & {m["mechanism"], *m["alternatives"]} for m in verdict["effects"]) else "no"
    )
