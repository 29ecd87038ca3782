"""From loads to counts and back, as the sensor file says."""

from dataclasses import replace

import numpy as np
import pytest

from tacdata.errors import FormatError, UsageError
from tacdata.sensor import Sensor, Transduction, default_sensor
from tacdata.transduction import Loads, Transducer

SENSOR = default_sensor()
COUNT = SENSOR.taxels.count


def sensor(**values):
    return replace(SENSOR, transduction=Transduction(**values))


def loads(force: float | np.ndarray = 0.0, closure=0.0, area=0.0, states=1):
    return Loads(*(np.full((states, COUNT), v) for v in (force, closure, area)))


def linear(**values):
    return Transducer.of(sensor(principle="linear", parameters={"per_newton": 2.0, "rest": 5.0}, **values))


def test_the_default_sensor_reads_its_offset_at_rest_and_more_under_load():
    transducer = Transducer.of(SENSOR)
    assert transducer.taxels == COUNT
    found = transducer.read(loads(np.array([0.0, 0.05, 0.1])[:, None] * np.ones(COUNT), states=3))
    assert np.allclose(found.counts[0], 9000)
    assert (np.diff(found.counts, axis=0) > 100).all()
    assert found.remarks == () and not found.saturated.any()


def test_gain_and_offset_are_those_of_each_taxel():
    gain, offset = np.linspace(100, 200, COUNT), np.linspace(-5, 5, COUNT)
    found = linear(gain=tuple(gain), offset=tuple(offset)).read(loads(force=0.5))
    assert np.allclose(found.counts[0], offset + gain * 1.0)
    assert np.allclose(found.capacitance, 6.0)


@pytest.mark.parametrize("principle", ["linear", "gap_closing", "soft_dielectric"])
def test_counts_go_back_to_loads(principle):
    transducer = Transducer.of(sensor(principle=principle, gain=(500.0,), offset=(100.0,)))
    random = np.random.default_rng(0)
    felt = Loads(*(random.uniform(0, 0.2, (7, COUNT)) for _ in range(3)))
    found = transducer.loads(transducer.read(felt).counts, felt.area)
    told = "closure" if principle == "gap_closing" else "force"
    assert np.allclose(getattr(found, told), getattr(felt, told), atol=1e-10)
    assert np.isnan(found.closure if told == "force" else found.force).all()


@pytest.mark.parametrize("principle", ["linear", "gap_closing", "soft_dielectric"])
def test_derivatives_are_those_of_the_counts(principle):
    transducer = Transducer.of(sensor(principle=principle, gain=(500.0,)))
    here, h = loads(0.1, 0.2, 0.5), 1e-6
    slopes = transducer.derivatives(here)
    for field in ("force", "closure", "area"):
        up, down = (
            transducer.read(Loads(**{**vars(here), field: getattr(here, field) + s * h})).counts for s in (1, -1)
        )
        assert np.allclose((up - down) / (2 * h), getattr(slopes, field), rtol=1e-5, atol=1e-6)


def test_the_electronics_end_at_full_scale_and_say_so():
    transducer = linear(gain=(100.0,), offset=(50.0,), full_scale=200.0)
    felt = loads(states=3)
    felt.force[:, 2] = [0.5, 0.75, 2.0]
    felt.force[1, 5] = -1.0
    found = transducer.read(felt)
    assert found.counts[:, 2].tolist() == [150.0, 200.0, 200.0] and found.counts[1, 5] == 0.0
    assert found.saturated.sum() == 2 and found.saturated[2, 2] and found.saturated[1, 5]
    assert any(
        "taxel 2: reading beyond the full scale of 200" in r and "1 of 3 states from state 2" in r
        for r in found.remarks
    )
    assert any("taxel 5: reading below 0" in r for r in found.remarks)
    slopes = transducer.derivatives(felt).force
    assert slopes[2, 2] == 0 and slopes[0, 2] == 200.0
    back = transducer.loads(found.counts).force
    assert np.isnan(back[2, 2]) and back[0, 2] == pytest.approx(0.5)


def test_plates_that_meet_are_named():
    transducer = Transducer.of(sensor(principle="gap_closing", parameters={"gap": 0.3}))
    felt = loads(states=4)
    felt.closure[:, 7] = [0.1, 0.2, 0.3, 0.4]
    found = transducer.read(felt)
    assert found.saturated[:, 7].tolist() == [False, False, True, True]
    assert len(found.remarks) == 1
    assert "taxel 7" in found.remarks[0] and "2 of 4 states from state 2" in found.remarks[0]


@pytest.mark.parametrize(
    ("felt", "words"),
    [
        (Loads(*[np.zeros((2, COUNT - 1))] * 3), rf"\(n, {COUNT}\)"),
        (Loads(*[np.zeros(COUNT)] * 3), "one row per state"),
        (Loads(np.zeros((2, COUNT)), np.zeros((3, COUNT)), np.zeros((2, COUNT))), "closure has the shape"),
        (Loads(np.zeros((2, COUNT)), np.zeros((2, COUNT)), np.full((2, COUNT), np.nan)), "area of taxel 0 in state 0"),
    ],
)
def test_loads_that_fit_no_sensor_are_refused(felt, words):
    with pytest.raises(FormatError, match=words):
        linear().read(felt)


def test_a_sensor_that_says_nothing_is_told_what_to_add():
    with pytest.raises(FormatError, match=r"principle: gap_closing \| linear \| soft_dielectric"):
        Transducer.of(replace(SENSOR, transduction=None))


def test_an_unknown_principle_is_refused():
    with pytest.raises(UsageError, match="did you mean 'gap_closing'"):
        Transducer.of(sensor(principle="gap_close"))


def test_a_dead_taxel_has_no_inverse():
    with pytest.raises(FormatError, match="gain of 0"):
        linear(gain=(0.0,)).loads(np.zeros((1, COUNT)))


def test_the_sensor_file_carries_it_there_and_back():
    document = sensor(principle="gap_closing", parameters={"gap": [0.5] * COUNT}, gain=tuple([3.0] * COUNT)).document
    again = Sensor.from_document(document, "there")
    assert again.transduction is not None and again.document == document
    assert Transducer.of(again).rest.shape == (COUNT,)


def test_labels_do_not_depend_on_it_and_readings_do():
    a, b = sensor(principle="linear"), sensor(principle="linear", gain=(2.0,))
    assert a.content_hash == b.content_hash == replace(SENSOR, transduction=None).content_hash
    assert a.transduction and b.transduction and a.transduction.content_hash != b.transduction.content_hash
