"""What one press alone shows has no name: it is told as what to repeat."""

import numpy as np
import pytest
from pressing import course

from tacdata.chain import Course, Tool
from tacdata.chain.rows import rows_of
from tacdata.discrepancy.judge import judge
from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.verdict.lone_press import lone_press


def softened(tops=(1.0, 2.0, 3.0, 4.0), cycles=4, share=0.25):
    """Return cycles to growing depths on one specimen, that softens up to the deepest so far: two channels."""
    rng, parts, clock, deepest = np.random.default_rng(2), [], 0.0, 0.0
    for top in np.repeat(tops, cycles):
        at = np.cumsum([0.0, 0.5, top, 0.5, top, 0.5])
        path = np.array([0.0, 0.0, top, top, 0.0, 0.0])
        time = np.arange(0, at[-1], 0.025)
        tip = np.interp(time, at, path)
        most = np.maximum(np.maximum.accumulate(tip), deepest)
        soft = np.where(tip < most - 1e-9, 1 - share * (1 - tip / np.maximum(most, 1e-9)), 1.0)
        deepest = max(deepest, float(top))
        load = 1.5 * tip**1.3 * soft
        values = np.column_stack([30 * load, 12 * load]) + 0.3 * rng.normal(size=(len(time), 2))
        parts.append((clock, rows_of(time, values, at, np.column_stack([0 * at, 0 * at, path]))))
        clock += at[-1] + 1.0
    episode = np.repeat(np.arange(len(parts)), [len(rows.time) for _, rows in parts])
    return Course(
        time=np.concatenate([begin + rows.time for begin, rows in parts]),
        episode=episode,
        tip=np.concatenate([rows.tip for _, rows in parts]),
        tool=np.zeros(len(episode), dtype=int),
        readings=np.concatenate([rows.values for _, rows in parts]),
        averaged=np.concatenate([rows.averaged for _, rows in parts]),
        session=np.zeros(len(parts), dtype=int),
        site=np.zeros(len(parts), dtype=int),
        tools=(Tool("ball", "sphere", 4.0),),
        names=tuple(f"press {k}" for k in range(len(parts))),
        centers=np.array([[-1.0, 0], [1, 0]]),
    )


def test_softening_that_one_first_loading_holds_is_told_with_its_press_and_what_to_repeat():
    made = judge(softened(), read_spec(None)).document
    assert made["status"] == "unknown" and made["effects"] == []
    assert "softening would explain" in made["why"] and "press 12 alone holds" in made["why"]
    assert made["next"][0].startswith("softening: repeat that press")


@pytest.mark.parametrize("delay", [0.0, 0.05])
def test_what_no_press_or_every_press_shows_is_no_lone_press(delay):
    problem = judge(course(delay=delay, episodes=12), read_spec(None), until="gate").found.problem
    assert lone_press(problem) is None
