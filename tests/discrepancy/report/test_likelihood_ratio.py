"""Sealed episodes are held against an answer with what scatters from press to press in mind."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.chain import predict
from tacdata.discrepancy.judge import judge
from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.report.conclude import with_sealed
from tacdata.discrepancy.report.likelihood_ratio import LikelihoodRatio, likelihood_ratio
from tacdata.discrepancy.report.sealed_gap import chosen, gap
from tacdata.discrepancy.report.sentence import sentence_of
from tacdata.effects import library

FEW = ("latency", "relaxation", "backlash")
OTHERS = tuple(dict.fromkeys(e.called for e in library() if e.called not in FEW))
SCATTER = 0.05
"""Each press's own gain is off by so much [1]."""


def judged(made):
    return judge(made, read_spec(None), without=OTHERS)


def fits(done):
    """Return the model before and after."""
    return done.conclusion.before, done.conclusion.after


def problems(done):
    return [fit.problem for fit in fits(done)]


def shaken(made, seed):
    """Return presses of which each has a gain of its own."""
    own = 1 + SCATTER * np.random.default_rng(seed).normal(size=made.episodes)
    return replace(made, readings=np.round(5000 + own[made.episode][:, None] * (made.readings - 5000)))


def noisy(made, noise, seed):
    more = noise * np.random.default_rng(seed).normal(size=made.readings.shape)
    return replace(made, readings=made.readings + more)


def with_share(made, done, share, of):
    """Return presses that read what an answer says, of some of them a share of what it changes."""
    without, answer = (predict(made, f.response, list(f.placed)).signal for f in fits(done))
    own = np.where(made.of(of), share, 1.0)[:, None]
    return replace(made, readings=without + own * (answer - without))


@pytest.fixture(scope="module")
def late():
    made = course(delay=0.05)
    return made, judged(made)


@pytest.fixture(scope="module")
def relaxing():
    """Return presses whose own gains are as large as what relaxes."""
    made = shaken(course(relaxed=0.05, noise=2.0, hold=4.0), seed=0)
    return made, judged(made)


def test_what_sealed_presses_are_off_by_chance_refutes_nothing(relaxing):
    """Their mean square is larger with the right name."""
    made, done = relaxing
    shown = gap(made, *problems(done), chosen(made))
    assert shown.after.sum() > shown.before.sum()
    assert shown.ratio is not None and shown.ratio.observed > 0.5 * shown.ratio.expected
    assert done.document["status"] == "named"
    assert [e["mechanism"] for e in done.document["effects"]] == ["relaxation"]


def test_a_name_that_only_the_open_presses_bear_out_is_refuted(late):
    """The sealed ones are on time: whatever is late in the others is no property of the sensor."""
    made, done = late
    assert done.document["status"] == "named"
    own = noisy(with_share(made, done, 0.0, chosen(made)), 1.0, 1)
    shown = gap(own, *problems(done), chosen(own))
    conclusion = with_sealed(replace(done.conclusion, sealed=shown))
    assert conclusion.status == "unknown" and not conclusion.named
    assert "do not show it (they hold" in sentence_of(conclusion, made)
    assert shown.ratio.observed < -0.8 * shown.ratio.expected


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_the_share_is_that_of_the_answer_in_the_readings(late, share):
    made, done = late
    own = with_share(made, done, share, np.arange(made.episodes))
    ratio = likelihood_ratio(own, *problems(done))
    assert ratio.share == pytest.approx(share, abs=1e-3)


def test_the_share_scatters_by_its_standard_error(relaxing):
    """Noise and presses' own gains are drawn again, with the answer in the readings."""
    made, done = relaxing
    own, off = with_share(made, done, 1.0, chosen(made)), []
    for seed in range(16):
        ratio = likelihood_ratio(shaken(noisy(own, 2.0, seed), seed), *problems(done))
        off.append((ratio.share - 1) * np.sqrt(ratio.power / ratio.scatter))
    assert abs(np.mean(off)) < 0.75 and 0.5 < np.std(off) < 1.5, off


def test_more_power_or_less_scatter_refutes_sooner():
    assert not LikelihoodRatio(3.0, 0.2).refutes and LikelihoodRatio(12.0, 0.2).refutes
    assert not LikelihoodRatio(12.0, 0.2, scatter=4.0).refutes
    assert not LikelihoodRatio(12.0, 0.2, known=3.0).refutes, "the answer's own size is not known well enough"
    assert not LikelihoodRatio(1e4, 0.6).refutes, "they are likelier with it, whatever its form is off by"
    assert LikelihoodRatio(12.0, 0.6).bears_out and not LikelihoodRatio(3.0, 0.6).bears_out
    assert not LikelihoodRatio(0.0, 0.0).refutes and not LikelihoodRatio(0.0, 0.0).bears_out
