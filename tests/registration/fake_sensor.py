"""A probe over a skin with known place, noise and faults; nothing of the virtual rig's world is in it."""

import numpy as np

from tacdata.registration.probe import Probe, StillReading
from tacdata.rig import Registration
from tacdata.sensor import default_sensor

SENSOR = default_sensor()
GUESS = Registration((-96.0, -61.5, -38.0), 1.2)


class FakeSensor(Probe):
    """Answers like a half space under a sphere: depth to a power, spread over the taxels as a Gaussian."""

    def __init__(self, place, seed=0, power=1.5, noise=4.0, gain=1500.0, dome=0.0, dead=(), width=1.6):
        self.place, self.rng = place, np.random.default_rng(seed)
        self.power, self.noise, self.dome, self.dead, self.width = power, noise, dome, dead, width
        self.gain = gain * self.rng.uniform(0.8, 1.2, SENSOR.taxels.count)
        self.offset = self.rng.normal(9000, 500, SENSOR.taxels.count)
        self.position, self.path = (-96.0, -61.5, -20.0), []

    def go(self, position, speed):
        assert speed > 0
        self.position = tuple(float(v) for v in position)
        self.path.append(self.position)

    def read(self, frames):
        clean = self.offset + self.answer()
        rows = np.round(clean + self.rng.normal(0, self.noise, (frames, len(clean))))
        return StillReading(rows.mean(axis=0), rows.std(axis=0, ddof=1), frames)

    def wait(self, seconds):
        pass

    def answer(self):
        x, y, depth = self.place.to_sensor(np.array([self.position]))[0]
        depth = max(depth + self.dome * (x**2 + y**2), 0.0)
        apart = ((SENSOR.taxels.centers - [x, y]) ** 2).sum(axis=1)
        answer = self.gain * depth**self.power * np.exp(-apart / (2 * self.width**2))
        answer[list(self.dead)] = 0.0
        return answer


def put_down(seed):
    """Where a sensor may lie that was put down by eye."""
    rng = np.random.default_rng([seed, 5])
    shift = rng.uniform(-1, 1, 3) * (0.7, 0.7, 0.5)
    return Registration(
        tuple((np.array(GUESS.origin) + shift).tolist()),
        GUESS.yaw + rng.uniform(-3, 3),
        tuple(rng.uniform(-0.02, 0.02, 2).tolist()),
    )
