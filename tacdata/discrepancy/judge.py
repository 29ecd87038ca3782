"""The workflow: gate, search, refine, rivals, leftovers; a `Judgement` comes out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from tacdata.discrepancy.candidates import Candidate
from tacdata.discrepancy.fit import clipped_t, gains
from tacdata.discrepancy.problem import Problem, Setting, frame, prepare
from tacdata.discrepancy.refine import Refined, refine
from tacdata.discrepancy.search import Left, Tested, best_shapes, fitted, held_out, leftovers, test
from tacdata.effects import Placed, load

ALPHA = 0.01
"""Share of flips that may do as well, over all candidates together."""
MOST = 4
"""Most effects in one verdict."""
TOP = 8
"""How many effects are tried as members of pairs and as rivals."""
RIVAL = 2.33
"""A rival is out when the winner is better by so many standard errors over episodes [1]."""
AGAIN = 3
"""Gauss-Newton steps when the noise was told again [1]."""
MINOR = 0.015
"""Share of what all explain that a further effect must explain [1]; less may be numerics of the larger ones."""
SWAPS = 2
"""How often a rival may take the place of an effect [1]."""
AHEAD = 1.0
"""By how many standard errors over episodes it must be ahead [1]."""
SIMPLER = 1.5
"""A rival with more numbers must pay for them, but for so much [nats]."""
CLOSE = 0.5
"""Candidates with at least this share of the best gain may be rivals [1]."""

Note = Callable[[str], None]


@dataclass(frozen=True)
class Member:
    """One effect of the answer, with those that would do as well."""

    placed: Placed
    error: dict[str, float]
    """Standard error of each parameter, in its unit."""
    at_bound: tuple[str, ...]
    """Parameters at a physical bound."""
    rivals: tuple[str, ...]
    """Mechanisms that explain the episodes as well in its place."""
    margins: dict[str, float]
    """Rival effect -> by how many standard errors over episodes the member is better."""
    necessity: float
    """By how many standard errors over episodes the model is worse without it."""
    losses: dict[str, float] = field(default_factory=dict)
    """Rival effect -> by how much half the whitened energy is larger with it [nats]."""


@dataclass(frozen=True)
class Judgement:
    """What was found."""

    gap: bool
    """Whether anything is missing."""
    tested: Tested
    members: tuple[Member, ...]
    left: Left
    """What is still predictable with the members in place."""
    explained: float
    """Gain of the members in half the whitened energy [nats]."""
    energy: tuple[np.ndarray, np.ndarray]
    """Half the whitened energy of each episode before and after [nats], each of shape (episodes,)."""
    values: np.ndarray
    """Whitened values behind each episode [1], shape (episodes,)."""
    problem: Problem
    """The model as it was given."""
    final: Problem
    """The model with the members in place."""
    gains: np.ndarray
    """Gain of each channel beyond the response's, as a calibration finds it [1], shape (channels,); 0 if fitted."""

    @property
    def share_left(self) -> float:
        """Share of what could be explained that the members leave [1]."""
        whole = self.left.gain + max(self.explained, 0.0)
        return self.left.gain / whole if whole > 0 else 0.0


def judge(setting: Setting, note: Note = lambda text: None) -> Judgement:
    """Find what a model lacks.

    Args:
        setting: Recordings, response, library.
        note: Is told what is being done.
    """
    note("gate: is there a gap")
    same = frame(setting)
    problem = prepare(setting, same)
    tested = test(problem)
    gap = bool(min(tested.p.min(initial=1.0), tested.p_generic) <= ALPHA)
    nothing = refine(setting, [], problem.frame)
    now, current, members = problem, nothing, []
    verdicts = tested
    while gap and len(members) < MOST:
        chosen = _next(now, verdicts)
        if not chosen:
            break
        note(f"fit: {', '.join(c.effect.name for c in chosen)}")
        best, _ = _race(now, current, chosen)
        if best is None:
            break
        whole = float((nothing.energy - best.energy).sum())
        if members and float((current.energy - best.energy).sum()) < MINOR * whole:
            break
        members = list(best.placed)
        # Noise told beside a large missing effect is too large: tell it again.
        same = frame(replace(setting, response=best.response, given=(*setting.given, *best.placed)))
        nothing = refine(setting, [], same)
        current = refine(replace(setting, response=best.response), best.placed, same, AGAIN)
        now = prepare(replace(setting, response=current.response), same, current.placed)
        verdicts = test(now, seed=len(members))
    note("rivals and leftovers")
    if members:
        problem = prepare(setting, same)
    found, current = _members(setting, current, problem)
    if found and [p.effect.name for p in current.placed] != [p.effect.name for p in now.placed]:
        now = prepare(replace(setting, response=current.response), same, current.placed)
    left = leftovers(now)
    return Judgement(
        gap, tested, tuple(found), left, float((nothing.energy - current.energy).sum()),
        (nothing.energy, current.energy), problem.evidence.rows, problem, now, _gains(now),
    )  # fmt: skip


def _gains(problem: Problem) -> np.ndarray:
    channels = problem.setting.course.channels
    if not len(problem.nuisances) or "channel_gain" not in problem.setting.nuisance:
        return np.zeros(channels)
    _, values = fitted(problem, [], np.arange(len(problem.folds)))
    unit = load("channel_gain").amplitudes[0].typical
    return np.broadcast_to(values[len(problem.tangent.columns) :] * unit, (channels,)).copy()


def _next(problem: Problem, tested: Tested) -> list[Candidate]:
    """Return effects worth adding: one, or two that only together do well; none if nothing is significant."""
    taken = {p.effect.called for p in (*problem.setting.given, *problem.placed)}
    best = best_shapes(problem)
    free = [c for c in best.values() if c.called not in taken]
    everything = np.arange(len(problem.folds))

    def gain(chosen: list[Candidate]) -> float:
        columns, values = fitted(problem, chosen, everything)
        return float(gains(problem.evidence.gram, columns, values).sum())

    singles = sorted(((gain([c]), c) for c in free), key=lambda item: -item[0])[:TOP]
    significant = {c.effect.name for c, p in zip(problem.candidates, tested.p, strict=True) if p <= ALPHA}
    order = [c for _, c in singles if c.effect.name in significant and clipped_t(held_out(problem, [c])) > 2.0]
    if order:
        return order[:3]
    pairs = [[a, b] for i, (_, a) in enumerate(singles) for _, b in singles[i + 1 :] if a.called != b.called]
    scored = sorted(((float(held_out(problem, p).sum()), p) for p in pairs), key=lambda item: -item[0])
    if tested.p_generic <= ALPHA and scored and clipped_t(held_out(problem, scored[0][1])) > 3.0:
        return scored[0][1][:1]
    return []


def _race(problem: Problem, current: Refined, chosen: list[Candidate]) -> tuple[Refined | None, list[Refined]]:
    """Refine each choice on the chain; return the best, if it is better than what there is, and the others."""
    everything = np.arange(len(problem.folds))
    tried = []
    for candidate in chosen:
        _, values = fitted(problem, [candidate], everything)
        first = candidate.placed(values[: len(candidate.columns)], problem.setting.course.channels)
        tried.append(refine(problem.setting, [*problem.placed, first], problem.frame))
    tried.sort(key=_cost)
    if not tried or clipped_t(current.energy - tried[0].energy) < RIVAL:
        return None, tried
    return tried[0], tried[1:]


def _members(setting: Setting, current: Refined, problem: Problem, swaps: int = SWAPS) -> tuple[list[Member], Refined]:
    """Test that every effect is needed and find those that would do as well in its place."""
    placed = list(current.placed)
    without: dict[int, Refined] = {}
    while len(placed) > 1:
        start = replace(setting, response=current.response)
        without = {k: refine(start, placed[:k] + placed[k + 1 :], problem.frame, 3) for k in range(len(placed))}
        need = {k: clipped_t(r.energy - current.energy) for k, r in without.items()}
        weakest = min(need, key=lambda k: need[k])
        if need[weakest] >= RIVAL:
            break
        current = without[weakest]
        placed = list(current.placed)
    if len(placed) == 1:
        without = {0: refine(setting, [], problem.frame)}
    made = []
    for k in range(len(placed)):
        member, better = _member(setting, current, without[k], k, problem)
        if better is not None and swaps > 0:
            # A rival that was behind to first order is ahead on the chain: it takes the place.
            return _members(setting, better, problem, swaps - 1)
        made.append(member)
    return made, current


def _member(
    setting: Setting, current: Refined, without: Refined, at: int, problem: Problem
) -> tuple[Member, Refined | None]:
    start = replace(setting, response=without.response)
    bare = problem if not without.placed else prepare(start, problem.frame, without.placed)
    mine = current.placed[at]
    everything = np.arange(len(bare.folds))
    best = best_shapes(bare)
    score = {}
    for name, candidate in best.items():
        columns, values = fitted(bare, [candidate], everything)
        score[name] = float(gains(bare.evidence.gram, columns, values).sum())
    top = max(score.values(), default=0.0)
    taken = {p.effect.called for p in current.placed}
    close = [n for n, s in score.items() if s >= CLOSE * top and best[n].called not in taken]
    close = sorted(close, key=lambda n: -score[n])[:TOP]
    margins, losses, rivals = {}, {}, []
    better: Refined | None = None
    for name in close:
        _, values = fitted(bare, [best[name]], everything)
        first = best[name].placed(values[: len(best[name].columns)], setting.course.channels)
        other = refine(start, [*without.placed, first], problem.frame)
        margins[name] = clipped_t(other.energy - current.energy)
        if (
            margins[name] < -AHEAD
            and (better is None or _cost(other) < _cost(better))
            and _cost(other) < _cost(current)
        ):
            better = other
        losses[name] = float((other.energy - current.energy).sum())
        richer = len(other.tangent.knobs) > len(current.tangent.knobs)
        if margins[name] < RIVAL and not (richer and _cost(other) > _cost(current) + SIMPLER):
            rivals.append(best[name].called)
    error, bound = _errors(current, at)
    need = clipped_t(without.energy - current.energy)
    return Member(mine, error, bound, tuple(dict.fromkeys(rivals)), margins, need, losses), better


def _cost(model: Refined) -> float:
    """Return half the whitened energy, every episode's say bounded below, with half a log of episodes a number."""
    return float(model.energy.sum()) + 0.5 * len(model.tangent.knobs) * float(np.log(max(len(model.energy), 2)))


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
