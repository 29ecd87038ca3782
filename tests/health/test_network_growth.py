"""By how much a network's error has grown, press by press."""

from dataclasses import replace

import pytest

from tacdata.health.advice import RECALIBRATE, advice
from tacdata.health.document import document, text
from tacdata.health.history import history
from tacdata.health.network_error import NetworkError, growth

BEFORE = {k: 0.05 + 0.01 * (k % 3) for k in range(11)}


def test_growth_is_paired_by_press():
    grown = growth(
        NetworkError("a" * 64, {k: 1.5 * v for k, v in BEFORE.items()}),
        NetworkError("a" * 64, BEFORE),
        [(k, k) for k in range(11)],
    )
    assert grown.value == pytest.approx(0.405, abs=1e-3) and grown.error < 1e-9
    assert growth(NetworkError("a" * 64, {}), NetworkError("a" * 64, BEFORE), [(0, 0)]) is None


@pytest.mark.parametrize(("factor", "worse"), [(1.5, True), (1.05, False)])
def test_a_network_that_errs_more_is_trained_again(monday, tuesday, factor, worse):
    wobble = {k: factor * v * (1.02 if k % 2 else 0.98) for k, v in BEFORE.items()}
    errors = {
        str(visit.session.folder): NetworkError("a" * 64, values)
        for visit, values in ((monday, BEFORE), (tuesday, wobble))
    }
    found = history([monday, tuesday], errors)
    said = [a for a in advice(found) if a.do == RECALIBRATE]
    assert bool(said) is worse
    assert document(found)["provenance"]["parents"]["network"] == "a" * 64
    assert "error in contact" in text(found)


def test_without_errors_at_both_visits_nothing_is_compared(monday, tuesday):
    found = history([monday, tuesday], {str(monday.session.folder): NetworkError("a" * 64, BEFORE)})
    assert not [c for c in found.comparisons[1][0].changes if c.quantity == "network error"]
    assert replace(found, network={}).network == {}
