"""From recordings and a model to a conclusion: seal, check, search, conclude, open the sealed presses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.alarms.all_alarms import alarms
from tacdata.discrepancy.data.checks import check
from tacdata.discrepancy.evidence.optimum import Optimum
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.posterior.bag import Posterior
from tacdata.discrepancy.posterior.gains import channel_gains, gains_of_halves
from tacdata.discrepancy.posterior.policy import POLICY, Policy
from tacdata.discrepancy.posterior.search import Search, posterior_of, without_effects
from tacdata.discrepancy.report.calibration import calibration_error, compliance_of_specimens, gains_beyond_calibration
from tacdata.discrepancy.report.conclude import conclude, with_alarms, with_checks, with_gains, with_sealed
from tacdata.discrepancy.report.conclusion import Conclusion, Fit, Named, Reason, Status, Step
from tacdata.discrepancy.report.sealed_gap import chosen as sealed_presses
from tacdata.discrepancy.report.sealed_gap import gap, without_readings
from tacdata.discrepancy.search.detection_limits import detection_limits
from tacdata.discrepancy.search.problem import Problem, prepare


def concluded(
    course: Course,
    setting: Setting,
    note: Callable[[str], None] = lambda text: None,
    policy: Policy = POLICY,
    given: Problem | None = None,
    until: Step = Step.DECIDE,
) -> Conclusion:
    """Return the conclusion on recordings.

    Args:
        course: The recordings.
        setting: The model, with a response made of `open_course(course)`.
        note: Called with each step.
        policy: Every number that decides.
        given: The model as it was given, where that was prepared before.
        until: The last step.
    """
    checks = check(setting)
    if until in (Step.GATE, Step.LOCATE):
        search = without_effects(setting, policy, given)
    else:
        search = posterior_of(setting, note, policy if until == Step.DECIDE else replace(policy, rounds=0), given)
    result = conclude(search, policy)
    before, after = _fits(search, setting, result)
    beyond = _beyond(result, setting, search, policy)
    result = with_gains(result, beyond)
    placed = tuple(one.placed for one in beyond)
    after = replace(after, placed=(*after.placed, *placed))
    note("the gap on sealed presses")
    sealed = gap(
        course, before.problem, after.problem, sealed_presses(course), placed, _without(search.posterior, result)
    )
    result = replace(
        result,
        checks=checks,
        sealed=sealed if len(sealed.names) else None,
        before=before,
        after=after,
        given=search.given,
        odd=tuple(int(k) for k in search.given.null.odd),
        limits=detection_limits(search.given),
    )
    if until != Step.DECIDE:
        return with_checks(replace(result, reason=Reason.STOPPED, until=Step(until)))
    result = with_alarms(_without_tolerated(result), _alarms(after.problem, result))
    return with_checks(with_sealed(result))


def open_course(course: Course) -> Course:
    """Return the recordings without the readings of the sealed presses."""
    return without_readings(course, sealed_presses(course))


def _fits(search: Search, setting: Setting, result: Conclusion) -> tuple[Fit, Fit]:
    """Return the model before and after, both with the noise of the set."""
    best = result.best
    empty = next(m for m in search.posterior.models if not m.placed)
    before = replace(search.given, null=search.null)
    own = replace(setting, response=best.response)
    after = prepare(own, search.null, best.placed, tested=False, among=())
    given = setting.given
    return (
        Fit(before, setting.response, given, empty.energy),
        Fit(after, best.response, (*given, *best.placed), best.energy),
    )


def _beyond(result: Conclusion, setting: Setting, search: Search, policy: Policy) -> list[Named]:
    """Return gains beyond calibration, or the compliance that specimens show where nothing else is there."""
    best = result.best
    every = np.arange(len(best.gram))
    found = gains_beyond_calibration(
        setting, channel_gains(best, setting, every, policy), gains_of_halves(best, setting, policy)
    )
    return found or (compliance_of_specimens(setting) if result.status is Status.NONE else [])


def _without(posterior: Posterior, result: Conclusion) -> dict[str, Optimum]:
    """Return the best set without each effect, where that was refined."""
    made = {m.name: m for m in posterior.models}
    others = {}
    for p in result.best.placed:
        name = tuple(sorted(q.effect.name for q in result.best.placed if q is not p))
        if name in made:
            others[p.effect.name] = made[name]
    return others


def _alarms(problem: Problem, result: Conclusion) -> tuple[Alarm, ...]:
    """Return the alarms of the residual; forms of its effects may be off by their share."""
    off = max((e.placed.effect.form_error**2 * e.bought for e in result.effects if not e.by_calibration), default=0.0)
    return alarms(problem, off)


def _without_tolerated(result: Conclusion) -> Conclusion:
    """Return the conclusion without a scale that is no more than the tolerance of an observer's calibration."""
    effects = tuple(e for e in result.effects if e.by_calibration or not calibration_error(e))
    if len(effects) == len(result.effects):
        return result
    if not effects and result.reason is not Reason.REMAINDER:
        return replace(result, effects=(), status=Status.NONE, reason=Reason.QUIET)
    return replace(result, effects=effects)
