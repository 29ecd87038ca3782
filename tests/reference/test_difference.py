"""A machine beside its healthy self: seeded faults get their names and sizes, healthy halves stay quiet."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from tacdata import documents
from tacdata.chain import Course, Tool
from tacdata.errors import FormatError
from tacdata.reference.difference import difference
from tacdata.reference.report import Machines, document, sentence, text

TIME = np.linspace(0.0, 10.0, 251)
DEPTH = np.interp(TIME, [0, 0.5, 4.0, 6.0, 9.5, 10.0], [0.0, 0.0, 70.0, 70.0, 0.0, 0.0])
WAY = np.sign(np.gradient(DEPTH, TIME)) * (np.abs(np.gradient(DEPTH, TIME)) > 2)
HEADING = Machines(("after",), ("before",), "", "A")


def machine(
    change,
    presses=12,
    loads=("20", "40"),
    seed=0,
    wander=0.01,
    effort=None,
    law=0.006 * DEPTH,
    seen=lambda course: course,
):
    """Compare presses of a motor with load, friction and wander; a change acts in the second half of each load.

    All presses are recorded as ``seen``: by another convention, or another logger.
    """
    rng = np.random.default_rng(seed)
    readings, names, measured = [], [], []
    for load in loads:
        for k in range(presses):
            base = 0.4 + 0.2 * np.abs(WAY) + 0.002 * float(load or 20) * WAY + law
            base = base + wander * rng.normal() * np.abs(WAY) + 0.02 * rng.normal(size=len(TIME))
            readings.append(change(load, base) if k >= presses // 2 else base)
            names.append(load)
            measured.append(k >= presses // 2)
    episodes = len(readings)
    rows = np.repeat(np.arange(episodes), len(TIME))
    tip = np.tile(np.column_stack([np.zeros((len(TIME), 2)), DEPTH]), (episodes, 1))
    course = Course(
        time=np.concatenate([TIME + 12 * k for k in range(episodes)]),
        episode=rows,
        tip=tip,
        tool=np.zeros(len(rows), dtype=np.int64),
        readings=np.concatenate(readings)[:, None],
        averaged=np.ones(len(rows)),
        session=np.array(measured, dtype=np.int64),
        site=np.zeros(episodes, dtype=np.int64),
        tools=(Tool("unknown", "unknown", np.nan),),
        names=tuple(f"press {k}" for k in range(episodes)),
        specimens=tuple(names),
        effort=effort,
    )
    return difference(seen(course), course.specimens, np.array(measured))


def late(by):
    return lambda load, base: np.interp(TIME - by, TIME, base)


FAULTS = {
    "friction either way": (lambda load, base: base + 0.12 * np.abs(WAY), "dry_friction", 0.12),
    "friction against the motion": (lambda load, base: base + 0.08 * WAY, "dry_friction", 0.08),
    "less friction": (lambda load, base: base - 0.1 * np.abs(WAY), "dry_friction", -0.1),
    "delay": (late(0.12), "latency", 0.12),
    "zero": (lambda load, base: base + 0.1, "zero", 0.1),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_seeded_fault_is_named_with_its_signed_size(fault):
    change, name, size = FAULTS[fault]
    found = machine(change)
    assert [m.name for m in found.named] == [name]
    for s in found.named[0].changed:
        assert s.value == pytest.approx(size, rel=0.2)
    assert found.named[0].changed


@pytest.mark.parametrize("way_in", [0.0, -0.5, -1.0], ids=["on the way out", "half on either way", "on the way in"])
def test_play_is_named_wherever_its_zero_was_found(way_in):
    play, last = 4.0, np.where(TIME < 6.0, 1.0, -1.0)
    healthy, late = (0.01 * np.maximum(x - 10.0, 0.0) ** 1.25 for x in (DEPTH, DEPTH + play * (way_in + (last < 0))))
    found = machine(lambda load, base: base + late - healthy, effort=False, law=healthy, wander=0.003)
    assert [m.name for m in found.named] == ["backlash"]
    for s in found.named[0].changed:
        assert s.value == pytest.approx(play, rel=0.2)


@pytest.mark.parametrize(
    ("name", "lag"),
    [("latency", 0.15), ("latency", 0.4), ("latency", 0.8), ("low_pass_filter", 0.15), ("low_pass_filter", 0.4)],
)
def test_a_delay_is_no_filter_at_any_length(name, lag):
    def change(load, base):
        if name == "latency":
            return np.interp(TIME - lag, TIME, base)
        share = 1 - np.exp(-0.04 / lag)
        return lfilter([share], [1, share - 1], base, zi=[(1 - share) * base[0]])[0]

    found = machine(change, presses=16)
    assert [m.name for m in found.named] == [name] and not found.named[0].rival
    assert all(s.value == pytest.approx(lag, rel=0.25) for s in found.named[0].changed)


def test_relaxation_is_no_long_filter():
    share = 1 - np.exp(-0.04 / 1.5)

    def relaxing(load, base):
        return base - 0.2 * (base - lfilter([share], [1, share - 1], base, zi=[(1 - share) * base[0]])[0])

    assert [m.name for m in machine(relaxing, presses=16).named] == ["relaxation"]


def mirrored(course):
    return replace(course, tip=course.tip * [1, 1, -1] + [0, 0, 70.0])


@pytest.mark.parametrize("fault", [*FAULTS, "gain"])
def test_an_axis_that_points_the_other_way_changes_no_name_and_no_size(fault):
    change = FAULTS[fault][0] if fault in FAULTS else lambda load, base: 0.4 + 1.2 * (base - 0.4)
    plain, other = machine(change), machine(change, seen=mirrored)
    assert [m.name for m in other.named] == [m.name for m in plain.named]
    sign = -1 if "against" in fault else 1
    for a, b in zip(plain.named, other.named, strict=True):
        assert [s.value for s in b.sizes] == pytest.approx([sign * s.value for s in a.sizes], rel=1e-3)


@pytest.mark.parametrize("amplitude", [1.0, 0.0], ids=["noise", "dead"])
def test_channels_without_a_signal_take_no_name_away(amplitude):
    noise = amplitude * np.random.default_rng(2).normal(size=(2 * 16 * len(TIME), 5))
    found = machine(
        FAULTS["delay"][0], presses=16, seen=lambda c: replace(c, readings=np.column_stack([c.readings, noise]))
    )
    assert [m.name for m in found.named] == ["latency"] and all(c.quiet for c in found.controls)
    assert {s.channel for s in found.named[0].changed} == {0}


@pytest.mark.parametrize("side", [0, 1])
def test_a_machine_that_is_read_more_often_has_no_less_of_a_filter(side):
    def seldom(course):
        row = np.arange(course.rows)
        keep = (course.session[course.episode] != side) | (row % 4 == 0)
        columns = {n: getattr(course, n)[keep] for n in ("time", "episode", "tip", "tool", "readings", "averaged")}
        return replace(course, **columns)

    found = machine(lambda load, base: base, seen=seldom, wander=0.002)
    assert found.status == "none" and found.probabilities["low_pass_filter"] < 0.5


def test_a_response_has_no_friction_that_ends_with_the_motion():
    found = machine(FAULTS["friction either way"][0], effort=False)
    assert not any("while it moves" in m.form for m in found.mechanisms)
    assert not any("held at rest" in m.form for m in machine(FAULTS["friction either way"][0], effort=True).mechanisms)


def test_a_fault_at_one_load_is_said_with_the_bound_at_the_other():
    found = machine(lambda load, base: base + 0.12 * np.abs(WAY) * (load == "20"), wander=0.002)
    words = sentence(found, "A")
    assert [m.name for m in found.named] == ["dry_friction"]
    assert "dry friction +0.12 A" in words and "at 20" in words and "nothing at 40 (less than" in words
    assert len(words.split()) <= 30


def test_healthy_halves_are_quiet_at_many_seeds():
    quiet = [machine(lambda load, base: base, seed=seed).status == "none" for seed in range(8)]
    assert all(quiet)


def test_what_no_shape_explains_stays_without_a_name():
    bump = 0.15 * np.exp(-0.5 * ((TIME - 2.2) / 0.3) ** 2)
    found = machine(lambda load, base: base + bump)
    assert found.status == "unknown" and found.differs
    assert "no known effect" in sentence(found, "A")


def test_the_control_is_drawn_and_printed():
    found = machine(FAULTS["friction either way"][0], presses=16)
    assert [c.quiet for c in found.controls] == [True, True]
    words = text(found, HEADING)
    assert "control, first half and second half of the healthy machine: quiet" in words
    documents.check(document(found, HEADING, {}), "difference", "test")


def test_a_machine_that_differs_from_itself_gives_no_name():
    found = machine(FAULTS["friction either way"][0], presses=16)
    loud = replace(found.controls[0], quiet=False)
    assert "NOT QUIET" in text(replace(found, controls=(loud,)), HEADING)


def test_presses_without_counterparts_are_refused_in_words():
    with pytest.raises(FormatError, match="no press of the same place"):
        machine(lambda load, base: base, presses=4)


def test_a_kind_has_the_speed_of_its_motion_and_the_depth_below_the_face(monkeypatch):
    """A fast press is mostly rest and hold, and its way begins in the air."""
    path = np.interp(TIME, [0, 5, 5.4, 9, 9.4, 10], [-5.0, -5.0, 70.0, 70.0, -5.0, -5.0])
    monkeypatch.setitem(globals(), "DEPTH", path)
    found = machine(lambda load, base: base + 0.1, loads=("",), effort=False)
    depth, speed = re.fullmatch(r"x 0, y 0 mm, (\S+) mm deep at (\S+) mm/s", found.conditions[0].name).groups()
    assert float(depth) == 70 and float(speed) == pytest.approx(75 / 0.4, rel=0.15)
    size = next(s for m in found.mechanisms for s in m.sizes)
    assert size.share == pytest.approx(size.peak / found.conditions[0].range[0])
