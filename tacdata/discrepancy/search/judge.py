"""The workflow: gate, search, refine, rivals, leftovers; a `Judgement` comes out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tacdata.chain import Response
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.nuisances import calibrated
from tacdata.discrepancy.noise.null_model import Frame, frame
from tacdata.discrepancy.regressors.candidates import Candidate
from tacdata.discrepancy.regressors.model_error import SPREAD
from tacdata.discrepancy.search.findings import Judgement, Member
from tacdata.discrepancy.search.gauss_newton import Refined, refine
from tacdata.discrepancy.search.j_test import Off, ahead
from tacdata.discrepancy.search.overlap import overlap
from tacdata.discrepancy.search.problem import Problem, prepare
from tacdata.discrepancy.search.screen import Left, Tested, best_shapes, fitted, leftovers, test
from tacdata.discrepancy.search.shortlist import ALPHA, RIVAL, TOP, shortlist
from tacdata.discrepancy.statistics.cluster_robust import Lent
from tacdata.discrepancy.statistics.gram_fit import clipped_t, gains
from tacdata.effects import Effect, load

GATE = ALPHA
"""The same for each of the gate's two looks: at all effects, and at columns that belong to none."""
MOST = 4
"""Most effects in one verdict."""
LIKELIER = 1.0
"""A rival is out by no fewer standard errors, however rare it is [1]."""
AGAIN = 3
"""Gauss-Newton steps when the noise was told again [1]."""
MINOR = 0.3
"""A further effect must explain so much of what the others' equations may be off about, in energy, of the share of it
that these could say press by press in other forms [1]."""
KEPT = 2.8
"""An effect stays in the answer if that is worse by so many standard errors without it [1]."""
SWAPS = 2
"""How often a rival may take the place of an effect [1]."""
AHEAD = 1.0
"""By how many standard errors over episodes it must be ahead [1]."""
SIMPLER = RIVAL**2 / 2
"""A rival with more numbers is out, too, if it does not pay for them but for so much [nats]: what `RIVAL` asks."""
FAR, BEHIND = 5.0, 0.8
"""Rivals are not refined that are behind to first order by so many standard errors and this share of the gain [1]."""
DECOYS = 0.05
"""No effect is named that more decoys do as well as [1]."""
TOLD = 3.0
"""A channel's gain is told by presses that say so many times what its prior does [1]."""
BOOTSTRAPS = 200
CLOSE = 0.5
"""Candidates with at least this share of the best gain may be rivals [1]."""

STEPS = ("gate", "locate", "fit", "decide")
"""Steps of the workflow, each of which may be the last: rivals and leftovers are only known after `decide`."""

Note = Callable[[str], None]


def judge(setting: Setting, note: Note = lambda text: None, until: str = "decide") -> Judgement:
    """Find what a model lacks.

    Args:
        setting: Recordings, response, library.
        note: Is told what is being done.
        until: The last step to make, one of `STEPS`.
    """
    note("gate: is there a gap")
    same = frame(setting)
    problem = prepare(setting, same)
    tested = test(problem)
    gap = bool(min(tested.p.min(initial=1.0), tested.p_generic) <= GATE)
    nothing = refine(setting, [], problem.frame)
    now, current, members = problem, nothing, []
    explained: list[tuple[Effect, float]] = []
    verdicts, beaten = tested, _beaten(problem, tested, {})
    while gap and len(members) < MOST and until not in STEPS[:2]:
        chosen = shortlist(now, verdicts)
        if not chosen:
            break
        note(f"fit: {', '.join(' with '.join(c.effect.name for c in one) for one in chosen)}")
        best, _ = _race(now, current, chosen, verdicts.lent)
        if best is None:
            break
        more = current.loss - best.loss
        added = _added(best, len(members), more)
        if members and more < MINOR * _off(explained, [effect for effect, _ in added], best.response, now):
            break
        explained += added
        members = list(best.placed)
        # Noise told beside a large missing effect is too large: tell it again.
        same = frame(replace(setting, response=best.response, given=(*setting.given, *best.placed)))
        nothing = refine(setting, [], same)
        current = refine(replace(setting, response=best.response), best.placed, same, AGAIN)
        now = prepare(replace(setting, response=current.response), same, current.placed)
        verdicts = test(now, seed=len(members))
        beaten = _beaten(now, verdicts, beaten)
    if until != "decide":
        bare = [Member(p, *_errors(current, k), (), {}, 0.0) for k, p in enumerate(current.placed)]
        return Judgement(
            gap, tested, tuple(bare), Left(0.0, 0.0), nothing.loss - current.loss,
            (nothing.energy, current.energy), problem.evidence.rows, problem, now, _gains(now), until,
        )  # fmt: skip
    note("rivals and leftovers")
    if members:
        problem = prepare(setting, same)
    found, current = _members(setting, current, problem, verdicts.lent)
    chance = [_decoys(setting, current, k, same, beaten) for k in range(len(found))]
    while len(found) > 1 and max(chance) > DECOYS:
        # Held-out episodes lie between others: a slow wander helps there, and is no effect.
        weakest = int(np.argmax(chance))
        rest = [p for k, p in enumerate(current.placed) if k != weakest]
        current = refine(replace(setting, response=current.response), rest, same, AGAIN)
        found, current = _members(setting, current, problem, verdicts.lent)
        chance = [_decoys(setting, current, k, same, beaten) for k in range(len(found))]
    found = [replace(m, decoys=share) for m, share in zip(found, chance, strict=True)]
    if found and [p.effect.name for p in current.placed] != [p.effect.name for p in now.placed]:
        now = prepare(replace(setting, response=current.response), same, current.placed)
    left = leftovers(now)
    return Judgement(
        gap, tested, tuple(found), left, nothing.loss - current.loss,
        (nothing.energy, current.energy), problem.evidence.rows, problem, now, _gains(now),
    )  # fmt: skip


def _beaten(problem: Problem, tested: Tested, before: dict[str, float]) -> dict[str, float]:
    """Return the least share of decoys that do as well as each mechanism, so far."""
    result = dict(before)
    for candidate, p in zip(problem.candidates, tested.p, strict=True):
        result[candidate.called] = min(result.get(candidate.called, 1.0), float(p))
    return result


def _decoys(setting: Setting, current: Refined, at: int, same: Frame, beaten: dict[str, float]) -> float:
    """Return the share of decoys that do as well as one effect: at the step that asked for it, or beside the others."""
    called = current.placed[at].effect.called
    if beaten.get(called, 1.0) <= ALPHA:
        return beaten[called]
    others = [p for k, p in enumerate(current.placed) if k != at]
    bare = prepare(replace(setting, response=current.response), same, others)
    return min(beaten.get(called, 1.0), _beaten(bare, test(bare), {}).get(called, 1.0))


def _gains(problem: Problem) -> np.ndarray:
    channels = problem.setting.course.channels
    if not calibrated(problem.setting):
        return np.zeros(channels)
    _, values = fitted(problem, [], np.arange(len(problem.folds)))
    unit, first = load("channel_gain").amplitudes[0].typical, len(problem.tangent.columns) + len(problem.forms)
    own = values[first : first + channels] * unit
    power = np.diag(problem.evidence.of(np.arange(len(problem.folds))))[problem.nuisances[:channels] + 1]
    return np.where(power > TOLD * problem.ridge[:channels], own, np.nan)


def _off(
    explained: list[tuple[Effect, float]], further: list[Effect], response: Response, problem: Problem | None = None
) -> float:  # fmt: skip
    """Return how much their equations may be off about of what effects explain, as far as further ones take it [nats].

    An effect of the same ambiguity group looks like another form of what is there, and takes more of it.

    Args:
        explained: Effects, each with what it explains [nats].
        further: Those that would be added.
        response: Of which not everything is known, either.
        problem: With columns for what the equations may be off about; without it they may take up all of a further one,
            as what a fitted response makes of them may in any case.
    """

    def off(one: Effect) -> float:
        own = [c for c in problem.candidates if c.effect.name == one.name] if problem else []
        alike = overlap(problem, own) if problem else 1.0
        kin = [SPREAD if effect.group == one.group else 1.0 for effect, _ in explained]
        return sum(
            much * (alike * (wide * effect.form_error) ** 2 + response.form_error**2)
            for wide, (effect, much) in zip(kin, explained, strict=True)
        )

    return min(off(one) for one in further)


def _added(model: Refined, before: int, more: float) -> list[tuple[Effect, float]]:
    """Return a model's effects but the first few, each with its share of what they explain together [nats]."""
    added = [p.effect for p in model.placed[before:]]
    return [(effect, more / len(added)) for effect in added]


def _race(
    problem: Problem, current: Refined, sets: list[list[Candidate]], lent: dict[bool, Lent | None]
) -> tuple[Refined | None, list[Refined]]:  # fmt: skip
    """Refine each choice on the chain; return the best, if it is better than what there is, and the others."""
    everything = np.arange(len(problem.folds))
    tried = []
    for chosen in sets:
        _, values = fitted(problem, chosen, everything)
        first, at = [], 0
        for candidate in chosen:
            own = values[at : at + len(candidate.columns)]
            first.append(candidate.placed(own, problem.setting.course.channels))
            at += len(candidate.columns)
        tried.append(refine(problem.setting, [*problem.placed, *first], problem.frame))
    tried.sort(key=_cost)
    if not tried:
        return None, tried
    for chosen in (_without_minor(tried, current), tried[0]):
        if _needed(problem.setting, chosen, current, problem.frame, lent) >= KEPT:
            return chosen, [other for other in tried if other is not chosen]
    return None, tried


def _without_minor(tried: list[Refined], current: Refined) -> Refined:
    """Return the best of what was tried, or the best with one effect less if what the last adds is its equation's."""
    best = tried[0]
    fewer = [other for other in tried if len(other.placed) < len(best.placed)]
    if not fewer:
        return best
    explained = _added(fewer[0], len(current.placed), current.loss - fewer[0].loss)
    there = [p.effect.name for p in fewer[0].placed]
    further = [p.effect for p in best.placed if p.effect.name not in there]
    minor = MINOR * _off(explained, further or [p.effect for p in best.placed[-1:]], best.response)
    return fewer[0] if fewer[0].loss - best.loss < minor else best


def _members(
    setting: Setting, current: Refined, problem: Problem, lent: dict[bool, Lent | None], swaps: int = SWAPS
) -> tuple[list[Member], Refined]:
    """Test that every effect is needed and find those that would do as well in its place."""
    placed = list(current.placed)
    without: dict[int, Refined] = {}
    while len(placed) > 1:
        start = replace(setting, response=current.response)
        without = {k: refine(start, placed[:k] + placed[k + 1 :], problem.frame, 3) for k in range(len(placed))}
        need = {k: _needed(start, current, r, problem.frame, lent) for k, r in without.items()}
        spare = [k for k in need if need[k] < KEPT]
        if not spare:
            break
        # Of those that could go, the one that the others stand in for best.
        current = without[min(spare, key=lambda k: _cost(without[k]))]
        placed = list(current.placed)
    if len(placed) == 1:
        without = {0: refine(setting, [], problem.frame)}
    made = []
    for k in range(len(placed)):
        member, better = _member(setting, current, without[k], k, problem, lent)
        if better is not None and swaps > 0:
            # A rival that was behind to first order is ahead on the chain: it takes the place.
            return _members(setting, better, problem, lent, swaps - 1)
        made.append(member)
    return made, current


def _needed(setting: Setting, model: Refined, without: Refined, frame: Frame, lent: dict[bool, Lent | None]) -> float:
    """Return by how much a model is ahead of one with fewer effects: what their equations leave asks for no others."""
    need = ahead(model, without, lent)
    return need if need < KEPT or not without.placed else ahead(model, without, lent, Off.of(setting, without, frame))


def _member(
    setting: Setting, current: Refined, without: Refined, at: int, problem: Problem, lent: dict[bool, Lent | None]
) -> tuple[Member, Refined | None]:
    start = replace(setting, response=without.response)
    bare = problem if not without.placed else prepare(start, problem.frame, without.placed)
    mine = current.placed[at]
    everything = np.arange(len(bare.folds))
    best = best_shapes(bare)
    each = {}
    for name, candidate in best.items():
        columns, values = fitted(bare, [candidate], everything)
        each[name] = gains(bare.evidence.gram, columns, values)
    score = {name: float(gain.sum()) for name, gain in each.items()}
    top = max(score.values(), default=0.0)
    first = each[max(score, key=lambda n: score[n])] if score else np.zeros(1)
    taken = {p.effect.called for p in current.placed}
    close = [n for n, s in score.items() if s >= CLOSE * top and best[n].called not in taken]
    close = [n for n in close if score[n] > BEHIND * top or clipped_t(first - each[n]) < FAR]
    close = sorted(close, key=lambda n: -score[n])[:TOP]
    margins, losses, rivals = {}, {}, []
    need = _needed(setting, current, without, problem.frame, lent)
    better: Refined | None = None
    for name in close:
        _, values = fitted(bare, [best[name]], everything)
        first = best[name].placed(values[: len(best[name].columns)], setting.course.channels)
        other = refine(start, [*without.placed, first], problem.frame)
        level = out(mine.effect, best[name].effect)
        margins[name] = ahead(current, other, lent)
        if margins[name] >= level:
            # Its equation may be off: what that explains is nothing against it.
            margins[name] = ahead(current, other, lent, Off.of(start, other, problem.frame, len(without.placed)))
        if (
            margins[name] < -AHEAD
            and (better is None or _cost(other) < _cost(better))
            and _cost(other) < _cost(current)
            and ahead(other, without, lent) > need
        ):
            better = other
        losses[name] = other.loss - current.loss
        richer = len(other.tangent.knobs) > len(current.tangent.knobs)
        if margins[name] < level and not (richer and _cost(other) > _cost(current) + SIMPLER):
            rivals.append(best[name].called)
    error, bound = _errors(current, at)
    chosen = _selected(bare, best, each, mine.effect.called)
    return Member(mine, error, bound, tuple(dict.fromkeys(rivals)), margins, need, losses, chosen), better


def out(mine: Effect, rival: Effect) -> float:
    """Return by how many standard errors an effect must be ahead of a rival.

    In the end it is as sure as `RIVAL` makes it where both are as likely beforehand: half a square is a nat. Nothing
    is so much likelier that the episodes need not be on its side.
    """
    return float(np.sqrt(max(RIVAL**2 + 2 * np.log(rival.odds / mine.odds), LIKELIER**2)))


def _selected(
    problem: Problem, best: dict[str, Candidate], each: dict[str, np.ndarray], mechanism: str
) -> float:  # fmt: skip
    """Return the share of resamplings of the episodes in which a mechanism explains most."""
    if not each:
        return 0.0
    names, count = list(each), len(problem.folds)
    fee = np.array([0.5 * len(best[n].columns) * np.log(max(count, 2)) for n in names])
    pick = np.random.default_rng(11).integers(count, size=(BOOTSTRAPS, count))
    table = np.stack([each[n] for n in names])
    top = np.argmax(table[:, pick].sum(axis=2) - fee[:, None], axis=0)
    return float(np.mean([best[names[k]].called == mechanism for k in top]))


def _cost(model: Refined) -> float:
    """Return half the whitened energy, every episode's say bounded below, with half a log of episodes a number."""
    return model.loss + 0.5 * len(model.tangent.knobs) * float(np.log(max(len(model.energy), 2)))


def _errors(current: Refined, at: int) -> tuple[dict[str, float], tuple[str, ...]]:
    error: dict[str, float] = {}
    bound = []
    spread = np.sqrt(np.maximum(np.diag(current.covariance), 0.0))
    for k, knob in enumerate(current.tangent.knobs):
        if knob.at != at:
            continue
        p, value = knob.parameter, knob.value(current.placed)
        size = float(spread[k]) * (abs(value) if knob.shape else p.typical)
        error[p.name] = max(error.get(p.name, 0.0), size)
        if not knob.shape and p.low < p.default and (value <= p.low * 0.999 or value >= p.high * 0.999):
            bound.append(p.name)
        elif value >= p.high * 0.999:
            bound.append(p.name)
    return error, tuple(bound)
