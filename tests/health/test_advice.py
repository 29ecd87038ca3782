"""What is advised of units with a fault, of healthy ones, and of a first visit."""

from dataclasses import replace

import numpy as np
import pytest
from planted_faults import KINDS
from unit_examples import SEED, Fault, record

from tacdata.health.advice import FIRST, NOTHING, WIRING, advice
from tacdata.health.history import history
from tacdata.health.visit import read_visit
from tacdata.health.wiring import wiring


def test_a_healthy_unit_needs_nothing(monday, tuesday):
    said = advice(history([tuesday, monday]))
    assert [a.do for a in said] == [NOTHING]


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_brings_its_advice_and_no_other(kind, monday, tmp_path):
    planted = KINDS[kind](np.random.default_rng(3))
    said = advice(history([monday, read_visit(record(tmp_path / "ill", SEED, 1, planted.fault))]))
    assert {(a.do, frozenset(a.channels)) for a in said} == {(planted.do, planted.channels)}, said


def test_a_first_visit_is_something_to_compare_with(monday):
    assert [a.do for a in advice(history([monday]))] == [FIRST]


@pytest.mark.parametrize("kind", ["a channel stands still", "any two swapped"])
def test_wiring_shows_at_a_first_visit_too(kind, tmp_path):
    planted = KINDS[kind](np.random.default_rng(4))
    said = advice(history([read_visit(record(tmp_path / "ill", SEED, 0, planted.fault))]))
    assert (said[0].do, frozenset(said[0].channels)) == (WIRING, planted.channels)


def test_many_dead_channels_mean_another_unit(monday, tmp_path):
    dead = Fault(counts=lambda counts, _: np.where(np.arange(24) % 5 == 0, 9000.0, counts))
    said = advice(history([monday, read_visit(record(tmp_path / "ill", SEED, 1, dead))]))
    assert said[0].do == "replace" and said[0].channels == (0, 5, 10, 15, 20)


def test_a_slow_loss_is_seen_against_the_first_visit(monday, tmp_path):
    """Four per cent a visit is within the tolerance of each step, not of all."""
    visits = [monday]
    for number in (1, 2, 3):
        weaker = np.where(np.arange(24) == 9, 0.96**number, 1.0)
        fault = Fault(truth=lambda truth, _, w=weaker: replace(truth, gain=tuple(np.array(truth.gain) * w)))
        visits.append(read_visit(record(tmp_path / f"visit-{number}", SEED, number, fault)))
    found = history(visits)
    beside = {against: change for against, change in found.changed if change.channel == 9}
    assert list(beside) == [0] and beside[0].value == pytest.approx(0.96**3 - 1, abs=0.03)
    assert [a.channels for a in advice(found)] == [(9,)]


def test_a_silent_channel_is_found_in_any_unit(monday):
    """In pF the noise is far below half a count of a board."""

    def small(entry):
        taxels = entry.document["taxels"]
        scaled = {name: [v and 1e-3 * v for v in taxels[name]] for name in ("idle_noise", "response")}
        return replace(entry, document={**entry.document, "taxels": {**taxels, **scaled}})

    alive = np.where(np.arange(24) == 7, 1e-6, 1e-3)
    measured = [replace(press, levels=alive * press.levels) for press in monday.responses]
    reference = [replace(press, levels=1e-3 * press.levels) for press in monday.responses]
    assert wiring([small(entry) for entry in monday.entries], measured, reference).dead == (7,)
