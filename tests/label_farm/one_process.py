"""Labelling without processes of workers: each takes half a second of the processor to start."""

from tacdata.label_farm.ledger.ledger import owner_name
from tacdata.label_farm.presses import model
from tacdata.label_farm.workers.desk import LocalDesk
from tacdata.label_farm.workers.engine import Engine
from tacdata.label_farm.workers.worker import Worker


class OneProcess(Engine):
    """Solves in the process that asks, by the workers' own steps; for tests of what is asked for and written."""

    def __init__(self, store, factory, sensors, workers, lease_seconds, devices=("cpu",)):
        super().__init__(store, sensors, lease_seconds)
        self._desk = LocalDesk(store.folder, owner_name(), lease_seconds, self._versions)
        self._worker = Worker(self._desk, factory)

    def tend(self, wanted, settled=False):
        while self._worker.step():
            pass

    def stop(self):
        self._ledger.release(owner_name(), blame=False)

    def close(self):
        super().close()
        self._desk.ledger.close()


def version(factory, sensor):
    """As `model.version`, which builds the model in a process of its own."""
    built = model.build(factory, sensor)
    return model.Version(built.content_hash, tuple(getattr(built, "remarks", ())))
