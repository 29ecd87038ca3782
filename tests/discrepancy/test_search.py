"""What chance says of candidates."""

from pressing import course

from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import frame
from tacdata.discrepancy.search import screen
from tacdata.discrepancy.search.problem import prepare
from tacdata.discrepancy.statistics.cluster_robust import clustered, lent
from tacdata.discrepancy.statistics.gram_fit import eliminated
from tacdata.effects import library


def freedom_of(problem):
    """Return what effects lend each other when all count, whatever is there."""
    gram, told = eliminated(problem.evidence.gram, problem.fixed, problem.fixed_ridge(0.0)), {}
    for c in problem.candidates:
        if not screen.follows_clock(c.effect):
            told.setdefault(c.effect.name, []).append(clustered(gram, c.columns))
    return lent(told).freedom


def test_what_is_there_does_not_keep_others_from_lending():
    """A delay leaves much in all that looks a little like one; beside it, the others scatter alike."""
    freedoms = []
    for delay in (0.0, 0.05):
        made = course(delay=delay)
        setting = Setting(made, FittedResponse(made), list(library()))
        problem = prepare(setting, frame(setting))
        tested = screen.test(problem)
        freedoms.append((freedom_of(problem), tested.lent[False].freedom))
        if delay:
            assert problem.candidates[int(tested.z.argmax())].called in ("latency", "low_pass_filter", "servo_lag")
    (_, quiet), (spoilt, mended) = freedoms
    assert spoilt < 0.6 * quiet, "or there is nothing to mend"
    assert mended > 2 * spoilt
