"""A folder of simulated presses: its plan, and its solved presses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from tacdata import documents, provenance, schemas
from tacdata.effects import Placed
from tacdata.errors import FormatError, UsageError
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.presses.ladder import Ladder, goes_up_otherwise
from tacdata.label_farm.simulated.plan import SimulationPlan
from tacdata.label_farm.simulated.press_draw import draw_press
from tacdata.label_farm.simulated.press_effects import specimen_effects
from tacdata.label_farm.simulated.shard import read_about, shard_files
from tacdata.label_farm.simulated.specimen import draw_specimen
from tacdata.paths import StrPath
from tacdata.plans import Press
from tacdata.sensor import Sensor

FILE = "simulation.json"
_DRAWING = tuple(f"tacdata.label_farm.simulated.{name}" for name in ("plan", "press_draw", "specimen"))
"""Code that decides the draw; each file of presses states the version of its solver."""


@dataclass(frozen=True)
class Simulation:
    """Everything that decides the solved presses of a folder, but for how many there are."""

    folder: Path
    """Where they lie."""
    plan: SimulationPlan
    sensor: Sensor
    """The design; specimens are drawn around it."""
    seed: int
    mesh_error: bool = False
    """Whether a coarser mesh gives the error of each map."""

    @cached_property
    def document(self) -> dict[str, Any]:
        """The folder's `FILE`."""
        return {
            "version": schemas.version("simulation"),
            "plan": self.plan.document,
            "sensor": self.sensor.document,
            "seed": self.seed,
            "mesh_error": self.mesh_error,
            "code": provenance.code_hash(*_DRAWING),
        }

    @cached_property
    def content_hash(self) -> str:
        """Hash of everything that decides a press."""
        return provenance.content_hash({k: v for k, v in self.document.items() if k != "version"})

    def check(self) -> None:
        """Refuse a plan that this sensor cannot serve, before seconds go into a mesh.

        Raises:
            FormatError: If no press can be drawn, no specimen, no effect, or no taxel would feel anything.
        """
        if not self.sensor.skin.protrusion_radius:
            raise FormatError(
                f"sensor {self.sensor.name}: a flat skin, of whose taxels the model knows no load",
                "a skin with protrusions on a board (skin/protrusion_radius, contact/board), and transduction",
                "describe these in the sensor file, as examples/eight_by_eight.yaml does; a flat skin's network learns "
                "from recorded presses alone (tacdata train)",
            )
        for shape in self.plan.shapes:
            # Drawn alone: among others, a shape that never fits would be passed over in silence.
            try:
                draw_press(replace(self.plan, shapes=(shape,)), self.sensor, self.seed, 0)
            except FormatError as error:
                raise FormatError(
                    f"shapes/{shape.name}: {error.given}", error.allowed, "correct its sizes, or narrow their ranges"
                ) from error
        draw_specimen(self.sensor, self.plan.specimens, self.seed, 0)
        specimen_effects(self.plan, self.sensor, self.seed, 0)

    def open(self) -> None:
        """Make the folder, or see that it is of the same simulation.

        Raises:
            UsageError: If it holds another one.
        """
        path = self.folder / FILE
        if not path.is_file():
            documents.write(path, self.document, "simulation")
            return
        stored = documents.read(path, "simulation")
        document = self.document
        differing = [k for k in ("sensor", "seed", "mesh_error", "code") if stored[k] != document[k]]
        if _solved_by(stored["plan"]) != _solved_by(document["plan"]):
            differing.insert(0, "plan")
        if differing:
            raise UsageError(
                f"{self.folder} holds presses of another {' and '.join(differing)}",
                "a new folder, or the same plan, sensor, seed and code",
                f"name another folder, or remove {self.folder}",
            )

    @classmethod
    def read(cls, folder: StrPath) -> Simulation:
        """Read the plan of a folder of presses.

        Raises:
            UsageError: If there is no such folder.
            FormatError: If its file is damaged.
        """
        folder = Path(folder)
        stored = documents.read(folder / FILE, "simulation")
        plan = SimulationPlan.from_document(stored["plan"], str(folder / FILE))
        sensor = Sensor.from_document(stored["sensor"], str(folder / FILE))
        return cls(folder, plan, sensor, stored["seed"], stored["mesh_error"])

    @cached_property
    def specimens(self) -> tuple[Sensor, ...]:
        """The specimens, by their numbers."""
        spread = self.plan.specimens
        return tuple(draw_specimen(self.sensor, spread, self.seed, n) for n in range(spread.count))

    def check_model(self, specimen: int, model: str) -> None:
        """Refuse to solve on with another model than the folder's presses of a specimen were solved with.

        Raises:
            UsageError: If it is another.
        """
        for path in shard_files(self.folder):
            about = read_about(path)
            if about.numbers[0] % len(self.specimens) == specimen and about.identity["model"] != model:
                raise UsageError(
                    f"{path} was solved by model {about.identity['model'][:12]}, this release's is {model[:12]}",
                    "presses of one model in a folder",
                    "go on with the release that solved it, or name a new folder",
                )

    @property
    def settled(self) -> set[int]:
        """Numbers of the presses that are solved or given up."""
        return {number for path in shard_files(self.folder) for number in read_about(path).numbers}

    def press(self, number: int) -> Press:
        """Return a press by its number."""
        return draw_press(self.plan, self.sensor, self.seed, number)

    def specimen(self, number: int) -> Sensor:
        """Return the specimen that a press is on: presses are dealt out in turn."""
        return self.specimens[number % len(self.specimens)]

    @cached_property
    def effects(self) -> tuple[tuple[Placed, ...], ...]:
        """Effects on the readings, for each specimen."""
        return tuple(specimen_effects(self.plan, self.sensor, self.seed, n) for n in range(len(self.specimens)))

    def job(self, press: Press, model: str) -> Job:
        """Return the job of a press, for a model of its specimen with this content hash."""
        step, specimen = self.plan.load_step, self.specimen(press.index)
        ladder = Ladder(first_step=min(0.05, step), load_step=step, unload_step=3 * step, tolerance=None)
        return Job(
            specimen.content_hash,
            model,
            press.indenter.document,
            press.x,
            press.y,
            press.yaw,
            ladder.depths(press.depth, goes_up_otherwise(specimen.contact)),
            None,
            press.tilt_x,
            press.tilt_y,
        )

    def missing(self, presses: int, size: int) -> Iterator[tuple[int, list[int]]]:
        """Yield (specimen, numbers of presses) to solve together, ``size`` at most.

        The batches of a number of presses are always the same, except for settled presses.
        """
        settled, count = self.settled, len(self.specimens)
        for start in range(0, presses, count * size):
            for specimen in range(count):
                numbers = range(start + specimen, min(start + count * size, presses), count)
                if unsettled := [n for n in numbers if n not in settled]:
                    yield specimen, unsettled


def _solved_by(plan: dict[str, Any]) -> dict[str, Any]:
    """Return the part of a plan that decides solved presses: effects and noise come later."""
    later = ("version", "name", "purpose", "noise", "effects")
    return {name: value for name, value in plan.items() if name not in later}
