"""The interface of a solver: built from a sensor once per process, it solves jobs."""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol

import tacdata.errors
from tacdata import provenance, registry, result_cache
from tacdata.errors import SolveError, TacdataError, UsageError
from tacdata.extras import missing_package
from tacdata.label_farm import environment
from tacdata.label_farm.presses.job import Job
from tacdata.labels import PathSolution
from tacdata.paths import cache_folder
from tacdata.sensor import Sensor
from tacdata.skin import code_version
from tacdata.skin.code_version import PLUGGABLE

FACTORY = "tacdata.label_farm.presses.fem:FemModel"
"""Dotted path of the function that builds the model of a sensor."""

ALONE = "tacdata.label_farm.presses.fem:LoneFemModel"
"""The same for a model that solves each press by itself, to the last bit."""

_CODE = tuple(
    f"tacdata.{name}" for name in ("provenance", "sensor", "surfaces", "indenters", "skin", "label_farm.presses")
)
"""Modules and packages that decide the version of the project's model, or its remarks."""

_PACKAGES = ("numpy", "scipy", "torch", "warp")
"""Packages without which no model is built."""

_TRIES = 3
"""How often a process that is killed is started again."""


class ProcessDied(SolveError):
    """The process that builds a model was killed, for example for its memory; the sensor is not to blame."""


class Model(Protocol):
    """Interface of a solver; another one is a class with these names.

    A model may also have ``batch``, how many jobs it likes at a time (1 without it), and ``solve_many(jobs)``, which
    yields each job with its solution or its SolveError as they are found, whatever became of the others.
    """

    @property
    def content_hash(self) -> str:
        """Hash of everything in the model that decides a result."""
        ...

    def solve(self, job: Job) -> PathSolution:
        """Solve one job; raises SolveError with the reason if it fails."""
        ...


def build(factory: str, sensor: Sensor) -> Model:
    """Build a model in this process; costs seconds.

    Raises:
        UsageError: If ``factory`` names nothing ("package.module:name").
        PackageError: If it needs a package of an extra that is not installed.
        SolveError: If the sensor cannot be modelled.
    """
    module, _, name = factory.partition(":")
    try:
        return getattr(importlib.import_module(module), name)(sensor)
    except (ImportError, AttributeError) as error:
        if isinstance(error, ImportError) and (lacking := missing_package(error, "the skin model")):
            raise lacking from None
        raise UsageError(f"no model {factory!r}: {error}", "package.module:name", "check the name") from error


def batch_size(model: Model) -> int:
    """Return how many jobs a model solves as one batch."""
    return max(1, int(getattr(model, "batch", 1)))


def solve_each(model: Model, jobs: Sequence[Job]) -> Iterator[tuple[Job, PathSolution | SolveError]]:
    """Yield each job with its solution or its error: one bad press does not stop the others.

    Errors of other kinds end it: the state of the process is not trusted any more.
    """
    if len(jobs) > 1 and hasattr(model, "solve_many"):
        yield from model.solve_many(jobs)  # ty: ignore[not-callable]
        return
    for job in jobs:
        try:
            yield job, model.solve(job)
        except SolveError as error:
            yield job, error


@dataclass(frozen=True)
class Version:
    """A model's version and remarks, known before anything is solved."""

    content_hash: str
    """Hash of everything in the model that decides a result."""
    remarks: tuple[str, ...] = ()
    """Remarks for the user, such as strains at which its material law is unstable."""


def version(factory: str, sensor: Sensor) -> Version:
    """Return the model's version, found by a process of its own, or kept from an earlier one of the project's model.

    The caller stays free of the solver's libraries, and the mesh is cached before the workers ask for it.

    Raises:
        SolveError: If the sensor cannot be modelled.
    """
    if factory != FACTORY:
        return _found(factory, sensor)
    match result_cache.load("versions", _deciding(sensor)):
        case {"version": str(version), "remarks": [*remarks]}:
            return Version(version, tuple(remarks))
    found = _found(factory, sensor)
    # Only now is there a mesh, which is part of what decides a version.
    result_cache.store("versions", _deciding(sensor), {"version": found.content_hash, "remarks": found.remarks})
    return found


def _deciding(sensor: Sensor) -> str:
    """Return a hash of all that decides the version of the project's model of a sensor."""
    # fTetWild makes another mesh at every run, so that files that are made again count as others.
    folders = (Path(code_version.__file__).parent / "mesh" / "shipped", cache_folder() / "meshes")
    states = [(path, path.stat()) for folder in folders for path in sorted(folder.glob("[!.]*.npz"))]
    meshes = [(path.name, state.st_size, state.st_mtime_ns) for path, state in states]
    plug_ins = [provenance.file_hash(path) for room in PLUGGABLE for path in registry.plug_ins(room).values()]
    installed = [find_spec(name) is not None for name in _PACKAGES]
    return provenance.content_hash([sensor.document, provenance.source_hash(*_CODE), meshes, plug_ins, installed])


def _found(factory: str, sensor: Sensor) -> Version:
    """Return the model's version, found by a process of its own."""
    request = json.dumps({"factory": factory, "sensor": sensor.document})
    for _ in range(_TRIES):
        finished = subprocess.run(
            environment.python("tacdata.label_farm.presses.model"),
            env=environment.variables(),
            input=request,
            capture_output=True,
            text=True,
        )
        # A negative code is a signal, as of the kernel where memory is short: that may pass.
        if finished.returncode >= 0:
            break
    try:
        answer = json.loads(finished.stdout)
    except ValueError:
        kind = ProcessDied if finished.returncode < 0 else SolveError
        raise kind(
            f"the skin model of {sensor.name} cannot be built{_how(finished.returncode)}:\n{finished.stderr[-2000:]}",
            "a model that can be built on this machine",
            "see the last lines above",
        ) from None
    if "error" in answer:
        raise getattr(tacdata.errors, answer["kind"], SolveError)(*answer["error"])
    return Version(answer["version"], tuple(answer["remarks"]))


def _how(code: int) -> str:
    return f", its process was ended by signal {-code} {_TRIES} times" if code < 0 else ""


def main() -> None:
    """Answer one question of `version` on standard input and output."""
    answer_to = os.dup(1)
    os.dup2(2, 1)  # output of libraries while they load must not mix with the result
    request = json.load(sys.stdin)
    try:
        model = build(request["factory"], Sensor.from_document(request["sensor"], "sensor"))
        answer = {"version": model.content_hash, "remarks": list(getattr(model, "remarks", ()))}
    except TacdataError as error:
        answer = {"kind": type(error).__name__, "error": [error.given, error.allowed, error.remedy]}
    os.write(answer_to, json.dumps(answer).encode())


if __name__ == "__main__":
    main()
