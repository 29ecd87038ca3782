"""Lack of fit: does another law of a family explain part of an answer's residual?

A mechanism is compared with the saturated model of its family (`tacdata.discrepancy.regressors.saturated`), which
contains it up to its form. This is the nested test of goodness of fit. The answer's residual is regressed on the
columns of that model.

- The held-out gain (folds of presses, ridge) is the test.
- The size is the explained part of half the sum of squares, less one half for each column: noise explains as much.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from tacdata.chain import predict
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.noise.gram import episode_grams
from tacdata.discrepancy.regressors.saturated import saturated
from tacdata.discrepancy.search.findings import Findings, FoundEffect
from tacdata.discrepancy.search.leftovers import Leftovers
from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.statistics.gram_fit import eliminated, t_value
from tacdata.effects import Family

STRENGTHS = (1e-3, 1e-2, 1e-1, 1.0)
"""Ridge weights that are tried [mean information of a column]."""
EXCITED = 1e-6
"""Columns with less information are left out [largest]."""
SURE_T = 2.0
"""Something is there from so many standard errors over episodes on [1]..."""
CLEAR_GAIN, CLEAR_T = 8.0, 1.0
"""...and another form of a named effect from so much evidence on (nats, held out), too, if many bear it [1]."""
ANOTHER_FORM = 0.15
"""A law of which its family explains this share more is another one [the effect's explained part]."""
MUCH = 0.15
"""Share of the residual that other families explain, from which it counts as left over [1]."""
SURE_GAIN = 5.0
"""Another family is there, too, if it lowers half the held-out sum of squares by so much [1]..."""
SURE_SHARE = 0.03
"""...and explains this share of the answer's own part: its laws may be off by less [1]."""
SHARE_LEFT = 0.05
"""Leftovers: largest share of the explainable that an answer may leave [1]."""
MODEL = {Family.CONTACT: Family.KINEMATICS}
"""Families that share a saturated model: where the tip is, and where it meets the skin."""


@dataclass(frozen=True)
class Lack:
    """Part that a family's saturated model explains in addition to an answer."""

    gain: float
    """Fall of half the whitened sum of squares, held out, summed over episodes [1]; 0 or more."""
    t: float
    """Its mean over episodes, in standard errors [1]."""
    size: float
    """The same of all episodes together, less the part of noise [1]; 0 or more."""


def of_family(finding: FoundEffect, lacking: Mapping[Family, Lack]) -> Lack | None:
    """Return the part that the saturated model of an effect's family explains; None if it has none."""
    family = finding.placed.effect.family
    return lacking.get(MODEL.get(family, family))


def another_form(finding: FoundEffect, lacking: Mapping[Family, Lack]) -> bool:
    """Return whether the saturated model of an effect's family explains significantly more than its law."""
    family_lack = of_family(finding, lacking)
    if family_lack is None or family_lack.size < ANOTHER_FORM * max(finding.bought, 0.0):
        return False
    return family_lack.t >= SURE_T or (family_lack.gain >= CLEAR_GAIN and family_lack.t >= CLEAR_T)


def with_families(findings: Findings, lacking: Mapping[Family, Lack]) -> Findings:
    """Return findings with a large residual that families outside the answer explain."""
    significant = [lacking[family] for family in _others(findings, lacking) if lacking[family].t >= SURE_T]
    largest = max(significant, key=lambda own: own.gain, default=None)
    if largest is None or largest.gain < max(findings.left.gain, MUCH * (largest.gain + max(findings.explained, 0.0))):
        return findings
    return replace(findings, left=Leftovers(largest.gain, largest.t))


def elsewhere(findings: Findings, lacking: Mapping[Family, Lack]) -> list[Family]:
    """Return families that the answer has nothing of, and that are surely there, too, the largest first."""
    significant = surely_elsewhere(findings, lacking)
    return [family for family in significant if lacking[family].size >= SURE_SHARE * max(findings.explained, 0.0)]


def surely_elsewhere(findings: Findings, lacking: Mapping[Family, Lack]) -> list[Family]:
    """Return families outside the answer that surely explain some of its residual, however little."""
    families = _others(findings, lacking) if lacking else []
    significant = [family for family in families if lacking[family].t >= SURE_T and lacking[family].gain >= SURE_GAIN]
    return sorted(significant, key=lambda family: -lacking[family].size)


def _others(findings: Findings, lacking: Mapping[Family, Lack]) -> list[Family]:
    """Return families outside the answer that explain more than these: models of families overlap."""
    answer_families = {MODEL.get(f.placed.effect.family, f.placed.effect.family) for f in findings.effects}
    largest_gain = max((lacking[family].gain for family in answer_families if family in lacking), default=0.0)
    return [family for family in lacking if family not in answer_families and lacking[family].gain > largest_gain]


def lack_of_fit(final: Problem) -> dict[Family, Lack]:
    """Return the part of an answer's residual that each family's saturated model explains.

    Args:
        final: The model with the answer in place.
    """
    setting, placed = final.setting, [*final.setting.given, *final.placed]
    course, streams = setting.course, Streams.of(setting.course)
    residual = streams.measured(course) - streams.predicted(predict(course, setting.response, placed))
    models = saturated(course, setting.response, placed)
    moving = final.tangent.values
    columns = np.concatenate([residual[:, :, None].astype(np.float32), *models.values(), moving], axis=2)
    white = final.null.whitener_for(setting, placed).whitened(columns)
    gram = episode_grams(white, course.reduced, final.null.nuisances, final.null.inner).gram
    last = columns.shape[2] - moving.shape[2]
    fixed = np.arange(last - 1, gram.shape[1] - 1)
    gram = eliminated(gram, fixed, np.concatenate([np.full(moving.shape[2], 1e-6), final.null.ridge]))
    result, first = {}, 1
    for family, family_columns in models.items():
        index = np.arange(first, first + family_columns.shape[2])
        result[family] = lack(gram[:, np.r_[0, index]][:, :, np.r_[0, index]], final.folds)
        first += family_columns.shape[2]
    return result


def lack(gram: np.ndarray, folds: np.ndarray) -> Lack:
    """Return the part that columns explain.

    Args:
        gram: Residual first, shape (episodes, 1 + k, 1 + k).
        folds: Fold of each episode, shape (episodes,).
    """
    total_gram = gram.sum(axis=0)
    information = np.diag(total_gram)[1:]
    excited = np.concatenate([[True], information > EXCITED * max(float(information.max(initial=0.0)), 1e-12)])
    gram, total_gram = gram[:, excited][:, :, excited], total_gram[np.ix_(excited, excited)]
    if gram.shape[1] < 2:
        return Lack(0.0, 0.0, 0.0)
    best = Lack(0.0, 0.0, _size(total_gram))
    mean = float(np.trace(total_gram[1:, 1:])) / (len(total_gram) - 1)
    # A saturated model fits anything. Only what it predicts in episodes left out counts, at the best shrinkage.
    for strength in STRENGTHS:
        each = np.zeros(len(folds))
        for fold in np.unique(folds):
            train, test = folds != fold, folds == fold
            total = gram[train].sum(axis=0)
            weights = np.linalg.solve(total[1:, 1:] + strength * mean * np.eye(len(total) - 1), total[1:, 0])
            inside = np.einsum("i,eij,j->e", weights, gram[test][:, 1:, 1:], weights, optimize=True)
            each[test] = gram[test][:, 0, 1:] @ weights - 0.5 * inside
        if each.sum() > best.gain:
            best = Lack(float(each.sum()), t_value(each), best.size)
    return best


def _size(total: np.ndarray) -> float:
    """Return half the sum of squares that columns explain, less that of noise [1]."""
    root = np.sqrt(np.diag(total)[1:])
    information, score = total[1:, 1:] / np.outer(root, root), total[1:, 0] / root
    power, axes = np.linalg.eigh(information)
    # Columns of a saturated model are nearly collinear: round-off along weak axes would count as explained.
    good = power > 1e-3 * power[-1]
    explained = np.square(axes[:, good].T @ score) / power[good]
    return max(0.5 * float(np.sum(explained) - np.count_nonzero(good)), 0.0)
