"""A touch finds the skin although readings drift and jump; it goes no deeper for it."""

import numpy as np
import pytest
from fake_sensor import GUESS, SENSOR, FakeSensor

from tacdata.errors import DeviceError
from tacdata.registration.evidence import touch_evidence
from tacdata.registration.touch_off import touch_off
from tacdata.rig import Registration

NOISE = np.full(SENSOR.taxels.count, 4.0)
X, Y, SKIN = GUESS.to_machine(*SENSOR.taxels.centers[9], 0.0)
LIMIT = 0.17
"""Largest difference of a registration without an uncertainty [mm]."""


class RestlessSensor(FakeSensor):
    """Offsets walk from reading to reading; a channel jumps while the indenter is within two stretches of height."""

    walk = 0.0
    """Standard deviation of an offset's step from reading to reading [counts]."""
    jumps = ()
    """Stretches of height above the skin [mm] in which a channel reads 60 counts too much, once each."""
    entered = None

    def go(self, position, speed):
        super().go(position, speed)
        above = position[2] - SKIN
        inside = next((jump for jump in self.jumps if jump[0] <= above <= jump[1]), None)
        if self.entered and inside != self.entered:
            self.jumps = tuple(jump for jump in self.jumps if jump != self.entered)
        self.entered = inside

    def read(self, frames):
        self.offset += self.rng.normal(0, self.walk, len(self.offset))
        reading = super().read(frames)
        if self.entered:
            reading.mean[5] += 60.0
        return reading

    @property
    def lowest(self):
        """Lowest height so far, above the skin [mm]."""
        return min(position[2] for position in self.path) - SKIN


def evidence(probe):
    return touch_evidence(probe, (X, Y, SKIN + 3.2), (X, Y), SKIN, LIMIT)


@pytest.mark.parametrize("walk", [0.0, 0.5, 1.0])
def test_a_slow_drift_is_no_contact(walk):
    errors = []
    for seed in range(25):
        probe = RestlessSensor(GUESS, seed)
        probe.walk = walk
        errors.append(evidence(probe).difference)
        assert probe.lowest > -0.25
    assert np.abs(errors).max() < 0.02


def jumping(seed, place=GUESS):
    probe = RestlessSensor(place, seed)
    high = np.random.default_rng(seed).uniform(0.15, 0.25)
    probe.jumps = ((high, high + 0.1),)
    return probe


def test_the_search_goes_on_below_a_jump_that_was_no_contact():
    for seed in range(10):
        probe = jumping(seed)
        assert evidence(probe).difference == pytest.approx(0.0, abs=0.02)
        assert probe.lowest > -0.25
        probe = jumping(seed)
        touches = touch_off(probe, "here", (X, Y), SKIN + 1.0, SKIN - 1.0, NOISE, 2)
        assert [touch.onset.height for touch in touches] == pytest.approx([SKIN, SKIN], abs=0.02)
        assert probe.lowest > -0.25


def test_a_jump_above_no_skin_leads_no_deeper_than_the_limit():
    missing = Registration((*GUESS.origin[:2], GUESS.origin[2] - 5.0), GUESS.yaw)
    probe = jumping(1, missing)
    with pytest.raises(DeviceError, match="no channel answered down to"):
        touch_off(probe, "here", (X, Y), SKIN + 1.0, SKIN - 0.5, NOISE, 2)
    assert -0.5 - 1e-9 <= probe.lowest < -0.4
    assert probe.position[2] == SKIN + 1.0
    probe = jumping(1, missing)
    with pytest.raises(DeviceError, match="no channel answers down to"):
        evidence(probe)
    assert probe.lowest > -LIMIT - 0.3 - 1e-9
