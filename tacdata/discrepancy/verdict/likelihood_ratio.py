"""The likelihood ratio of sealed episodes with and without an answer, and its standard error.

The ratio is that of the density of sealed episodes given the open ones: log density of all less that of the open. The
covariance is the null model's: noise, offsets, pose and gain errors of each press. The open episodes determine the
gains and scales that calibration leaves open.

Let d be the change of the predictions by the answer and r the residual without it. The log-likelihood ratio is
d'r - d'd / 2. The share of the answer found in the data, d'r / d'd, is equivalent. Its expectation is 1 with the
answer and 0 without.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tacdata.chain import Course, predict
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.noise.nuisances import nuisance_columns
from tacdata.discrepancy.regressors.stack import apart, side_by_side
from tacdata.discrepancy.search.findings import Findings
from tacdata.discrepancy.statistics.gram_fit import eliminated
from tacdata.discrepancy.verdict.calibration import gains_beyond_calibration
from tacdata.effects import Placed

REFUTED_Z = 2.33
"""One-sided level of 1 % at which a name is withdrawn, since it has passed every other test [standard errors]."""
SHOWN_Z = 1.645
"""One-sided level of 5 % at which sealed episodes alone support an answer [standard errors]."""
HALF = 0.5
"""Share of an answer at which sealed episodes are as likely with it as without [1]."""


@dataclass(frozen=True)
class LikelihoodRatio:
    """Likelihood ratio of sealed episodes: with an answer over without."""

    power: float
    """d'd: twice the log-likelihood ratio that is expected with the answer [1]."""
    share: float
    """Share of the answer that the sealed episodes show [1]."""
    scatter: float = 1.0
    """Variance of open episodes' scores over that of the covariance, at least 1 [1]."""
    known: float = float("inf")
    """d'd of the open episodes, which gave the answer its size [1]."""

    @property
    def observed(self) -> float:
        """The log-likelihood ratio [1]."""
        return self.power * (self.share - HALF)

    @property
    def expected(self) -> float:
        """Expectation of the log-likelihood ratio with the answer [1]; without, it is the negative of this."""
        return HALF * self.power

    @property
    def error(self) -> float:
        """Standard error of the share with the answer [1]: by sealed episodes, and by the answer's size."""
        return float(np.sqrt(self.scatter * (1 / self.power + 1 / self.known))) if self.power > 0 else float("inf")

    @property
    def refutes(self) -> bool:
        """Whether sealed episodes refute the answer.

        They are likelier without it, and their ratio is significantly below its expectation with the answer (one-sided,
        1 %). This is the test of a model by its likelihood ratio against another (Cox, Proc. 4th Berkeley Symposium 1,
        1961, 105). The error of the answer's size enters as in Chow (Econometrica 28, 1960, 591).
        """
        return self.share < HALF and self.share + REFUTED_Z * self.error < 1

    @property
    def bears_out(self) -> bool:
        """Whether sealed episodes support the answer: their ratio is significant against no answer, at 5 %."""
        return self.power > 0 and self.share > SHOWN_Z * float(np.sqrt(self.scatter / self.power))

    def document(self) -> dict[str, float | None]:
        """Return it as in the verdict."""
        error = self.error if np.isfinite(self.error) else None
        return {"observed": self.observed, "expected": self.expected, "share": self.share, "error": error}


def likelihood_ratio(course: Course, findings: Findings) -> LikelihoodRatio | None:
    """Return the likelihood ratio of sealed episodes; None where no effect was found.

    Args:
        course: All recordings, with the readings that the search did not have.
        findings: Findings without them.
    """
    model, beyond = findings.final, [f.placed for f in gains_beyond_calibration(findings)]
    fewer, model_effects = findings.problem.setting.course, list(model.setting.given)
    open_rows = np.isin(course.read, fewer.read)
    if open_rows.all() or not (model.placed or beyond):
        return None
    setting = replace(model.setting, course=course, given=(*model_effects, *model.placed))
    whitener, open_whitener = model.null.whiteners(setting, fewer)
    streams = Streams.of(course)
    without = streams.predicted(predict(course, findings.problem.setting.response, model_effects))
    change = streams.predicted(predict(course, setting.response, [*setting.given, *beyond])) - without
    nuisances, ridge = nuisance_columns(setting, setting.given)
    nuisances = _beside(nuisances, beyond, course.channels)
    columns = side_by_side([streams.measured(course) - without, change, *apart(nuisances)])
    open_grams = open_whitener.episode_grams(columns[open_rows]).gram
    open_marginal = _marginal(open_grams.sum(axis=0), ridge)
    full_marginal = _marginal(whitener.episode_grams(columns).gram.sum(axis=0), ridge)
    power = float(full_marginal[1, 1] - open_marginal[1, 1])
    if power <= 0:
        return LikelihoodRatio(0.0, 0.0)
    each = eliminated(open_grams, np.arange(1, open_grams.shape[1] - 1), ridge)
    score = each[:, 0, 1] - each[:, 1, 1]
    # At least 1: where open episodes scatter less by chance, sealed ones must not refute an answer more easily.
    scatter = max(float(np.sum(np.square(score))) / max(float(each[:, 1, 1].sum()), 1e-12), 1.0)
    return LikelihoodRatio(
        power, float(full_marginal[0, 1] - open_marginal[0, 1]) / power, scatter, max(float(open_marginal[1, 1]), 1e-12)
    )


def _beside(nuisances: np.ndarray, beyond: list[Placed], channels: int) -> np.ndarray:
    """Return nuisance columns with the gains that were found projected out of the channels' gains, which come first."""
    if not beyond:
        return nuisances
    sizes = [np.broadcast_to(next(iter(p.values.values())), channels) for p in beyond]
    directions = np.linalg.qr(np.stack(sizes, axis=1).astype(float))[0]
    result = nuisances.copy()
    result[:, :, :channels] -= (nuisances[:, :, :channels] @ directions) @ directions.T
    return result


def _marginal(gram: np.ndarray, ridge: np.ndarray) -> np.ndarray:
    """Return the Gram matrix of the first two columns with the others integrated out, shape (2, 2)."""
    further = gram[2:, 2:] + np.diag(ridge)
    return gram[:2, :2] - gram[:2, 2:] @ np.linalg.solve(further, gram[2:, :2])
