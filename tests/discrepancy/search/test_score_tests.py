"""What chance says of candidates."""

from pressing import course

from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.search.problem import prepare
from tacdata.discrepancy.search.score_tests import score_tests
from tacdata.discrepancy.statistics.cluster_robust import clustered_score, pooled_excess
from tacdata.discrepancy.statistics.gram_fit import eliminated
from tacdata.effects import library


def freedom_of(problem):
    """Return what effects lend each other when all count, whatever is there."""
    gram, scores = eliminated(problem.grams.gram, problem.fixed, problem.fixed_ridge(0.0)), {}
    for c in problem.candidates:
        if not c.effect.follows_clock:
            scores.setdefault(c.effect.name, []).append(clustered_score(gram, c.columns))
    return pooled_excess(scores).freedom


def test_what_is_there_does_not_spoil_the_prior_of_others():
    """A delay leaves much in all that looks a little like one; beside it, the others scatter alike."""
    freedoms = []
    for delay in (0.0, 0.05):
        made = course(delay=delay)
        setting = Setting(made, FittedResponse(made), list(library()))
        problem = prepare(setting, null_model(setting))
        tested = score_tests(problem)
        freedoms.append((freedom_of(problem), tested.pooled[False].freedom))
        if delay:
            assert problem.candidates[int(tested.z.argmax())].called in ("latency", "low_pass_filter", "servo_lag")
    (_, quiet), (spoilt, mended) = freedoms
    assert spoilt < 0.6 * quiet, "or there is nothing to mend"
    assert mended > 2 * spoilt
