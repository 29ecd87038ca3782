"""From what was found to what may be said: named, ambiguous, unknown or none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.discrepancy.data.identifiability import lookalikes
from tacdata.discrepancy.search.findings import Judgement, Member
from tacdata.discrepancy.search.judge import DECOYS, GATE
from tacdata.effects import Placed, load

LEFT = 0.05
"""Share of the explainable that may be left before no name is given [1]."""
ALONE = 0.15
"""The same for a single effect of which every rival leaves more than that again [1]."""
LEFT_T = 2.0
"""Leftovers count when they show over episodes by so many standard errors [1]."""
FAR = 5.0
"""A rival beaten by so many standard errors over episodes is out, whatever the answer leaves [1]."""
SURE = 3.0
"""Without any effect that helps, leftovers must show by so many standard errors to be called a gap [1]."""
LOUD = 2.0
"""A residual of so many times the noise floor is not nothing, even if several episodes bear no effect out [1]."""
BEYOND = 3.0
"""A channel's gain is more than calibration's business beyond so many of its standard deviations [1]."""
OUTLYING = 4.0
"""... or, where all together scatter little, of what the others scatter by [1]."""
WIDE = 2.0
"""Gains scatter more than calibration leaves open beyond so many of its standard deviations [1]."""
RARE = 0.003
"""What so few decoys do as well as is needed, whatever the two models' own episodes make of it [1]."""
VIEW, SCALES = "view_scale", ("view_scale", "travel_scale")
"""Scale of a second observation; what it cannot be told from where nothing else follows the tip."""
CALIBRATED = 0.005
"""Standard deviation of that scale: what calibrating a camera or a gauge leaves [1]."""
COMMON = ("modulus", "thickness")
"""What a common gain cannot be told from without a force reading."""


def adequate(found: Judgement, answer: list[Member]) -> bool:
    """Return whether nothing much is left to explain.

    Real things have other forms than any library. What a single effect leaves is its own form where every rival would
    leave twice as much, or more.
    """
    if found.left.t < LEFT_T or found.share_left < LEFT:
        return True
    if len(answer) != 1 or settled(answer[0]) != "named" or found.share_left >= ALONE:
        return False
    return all(loss > found.left.gain for loss in answer[0].losses.values())


def members(found: Judgement) -> list[Member]:
    """Return the effects of the answer, those that calibration shows among them."""
    course = found.problem.setting.course
    own = []
    for m in found.members:
        effect = m.placed.effect
        more = [*m.rivals, *lookalikes(course, effect, m.placed.values), *_hidden(found, m)]
        own.append(replace(m, rivals=tuple(name for name in dict.fromkeys(more) if name != effect.called)))
    return [*(m for m in own if not _of_calibration(m)), *calibrated(found)]


def _hidden(found: Judgement, member: Member) -> list[str]:
    """Return rivals that are worse by less than what the answer itself leaves: another form may turn them around."""
    if found.left.t < LEFT_T:
        return []
    near = [name for name, loss in member.losses.items() if loss < found.left.gain]
    return [load(name).called for name in near if member.margins[name] < FAR]


def calibrated(found: Judgement) -> list[Member]:
    """Return gains that are beyond what calibration leaves open: common to all channels, or of some."""
    prior = found.problem.setting.nuisance.get("channel_gain")
    known = found.gains[np.isfinite(found.gains)]
    if prior is None or not np.any(known):
        return []
    made = []
    common = float(np.median(known))
    if abs(common) > BEYOND * prior / np.sqrt(len(known)) * 2:
        placed = Placed(load("gain"), {"e": np.array(common)})
        error = float(1.25 * np.std(known) / np.sqrt(len(known)))
        rivals = COMMON if found.problem.setting.course.force is None else ()
        made.append(Member(placed, {"e": error}, (), rivals, {}, abs(common) / max(error, 1e-9), needed=BEYOND))
    own = np.nan_to_num(found.gains - common)
    spread = float(np.sqrt(np.mean(np.square(known - common))))
    # Gains may all be worse than calibration was thought to be; else a channel must stand out against its kind.
    usual = prior if spread > WIDE * prior else max(prior, 1.4826 * float(np.median(np.abs(known - common))))
    far = np.abs(own) > (BEYOND if spread > WIDE * prior else OUTLYING) * usual
    if far.any():
        placed = Placed(load("channel_gain"), {"e": np.where(far, own, 0.0)})
        made.append(Member(placed, {"e": prior}, (), (), {}, float(np.abs(own).max() / prior), needed=BEYOND))
    return made


def _of_calibration(member: Member) -> bool:
    """Return whether a drive and its observer disagree by no more than calibrating the observer leaves open."""
    placed = member.placed
    called = {placed.effect.called, *member.rivals}
    if VIEW not in called or placed.effect.called not in SCALES:
        return False
    return all(abs(float(value)) <= BEYOND * CALIBRATED for value in placed.values.values())


def loudness(found: Judgement) -> float:
    """Return the mean square of the whitened residual of the model as it was given [noise floor]."""
    return 2 * float(found.energy[0].sum()) / max(float(found.values.sum()), 1.0)


def status(found: Judgement) -> str:
    """Return the verdict: none, named, ambiguous or unknown."""
    answer = members(found)
    if found.until != "decide":
        return "unknown" if found.gap else "none"
    quiet = "unknown" if loudness(found) > LOUD or len(found.problem.frame.odd) else "none"
    if not found.gap and not answer:
        return quiet
    if not answer and found.tested.p_generic > GATE and found.left.t < SURE:
        return quiet  # one effect in a hundred flips, and nothing that bears it out
    if not answer or not adequate(found, answer):
        return "unknown"
    return "ambiguous" if any(settled(m) != "named" for m in answer) else "named"


def settled(member: Member) -> str:
    """Return whether one effect may be named: named or ambiguous."""
    needed = member.necessity >= member.needed
    if member.decoys is not None:
        needed = member.decoys <= (DECOYS if needed else RARE)
    return "named" if needed and not member.rivals and not member.at_bound else "ambiguous"
