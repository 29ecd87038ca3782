"""How many presses a worker takes at a time."""

import pytest
from farm_examples import SENSOR

from tacdata.label_farm.ledger.ledger import Lease
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.workers import worker
from tacdata.label_farm.workers.worker import Worker


class CountingDesk:
    """A desk with many jobs, that notes how many are claimed at a time."""

    def __init__(self):
        self.counts = []

    def offers(self):
        return ["version"]

    def sensor(self, version):
        return SENSOR

    def claim(self, version, count):
        self.counts.append(count)
        jobs = [Job(SENSOR.content_hash, version, {}, 0.0, 0.0, 0.0, (0.1 * k,)) for k in range(count)]
        return [Lease(job, 1) for job in jobs]

    def has(self, job):
        return True

    def finish(self, job, seconds):
        pass


class BatchModel:
    """A model of a version that is asked for."""

    content_hash = "version"

    def __init__(self, batch):
        self.batch = batch


@pytest.mark.parametrize(
    ("batch", "counts"), [(16, [1, 16, 16]), (512, [512, 512, 512]), (1, [1, 1, 1])], ids=["cpu", "gpu", "single"]
)
def test_a_cpu_solves_one_press_before_its_batches(monkeypatch, batch, counts):
    monkeypatch.setattr(worker, "build", lambda factory, sensor: BatchModel(batch))
    desk = CountingDesk()
    taker = Worker(desk, "")
    assert all(taker.step() for _ in counts)
    assert desk.counts == counts
