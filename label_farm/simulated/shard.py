"""Solved presses of one batch in one compact file (NPZ): the source of episodes, on any machine."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from tacdata.errors import FormatError
from tacdata.labels import PathSolution
from tacdata.labels.columns import PATH_REQUIRED
from tacdata.paths import StrPath
from tacdata.replacement import replacement

GRAIN = 1e-4
"""Resolution of stored maps [mm]: far below the mesh's error. 16 bits reach 3.2 mm; deeper maps take 32."""
_GRAINED = ("surface", "numerical")
"""Maps of a solution, stored as multiples of `GRAIN`."""
_SINGLE = tuple(name for name in PATH_REQUIRED if name not in (*_GRAINED, "depth"))
"""Arrays of a solution that are stored in single precision."""
_NAME = re.compile(r"presses-(\d{7})-(\d{7})\.npz")


@dataclass(frozen=True)
class Shard:
    """Solved presses of one specimen, and why others were given up."""

    solutions: Mapping[int, PathSolution]
    """Number of the press -> its solution."""
    failed: Mapping[int, str]
    """Number of the press -> the reason, in words."""
    identity: dict[str, Any]
    """Everything that decided the solutions: hashes of sensor, mesh, settings and code (`SkinModel.identity`)."""

    @property
    def numbers(self) -> list[int]:
        """Presses that are settled, sorted."""
        return sorted([*self.solutions, *self.failed])

    def write(self, folder: Path) -> Path:
        """Write the file into a folder, so that a crash leaves all of it or nothing; return its path."""
        numbers = sorted(self.solutions)
        solutions = [self.solutions[n] for n in numbers]
        arrays: dict[str, np.ndarray] = {
            "number": np.array(numbers, dtype=np.int64),
            "states": np.array([len(s.depth) for s in solutions], dtype=np.int64),
            "depth": _joined([s.depth for s in solutions], float),
            "about": np.array(json.dumps({"identity": self.identity, "failed": dict(self.failed)}, sort_keys=True)),
        }
        for name in _GRAINED:
            grains = _joined([np.round(getattr(s, name) / GRAIN) for s in solutions], np.int32)
            # Half the size, where all numbers fit.
            arrays[name] = grains.astype(np.int16) if np.abs(grains).max(initial=0) < 2**15 else grains
        for name in _SINGLE:
            arrays[name] = _joined([getattr(s, name) for s in solutions], np.float32)
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **arrays)  # ty: ignore[invalid-argument-type]
        path = folder / f"presses-{self.numbers[0]:07d}-{len(self.numbers):07d}.npz"
        with replacement(path) as stream:
            stream.write(buffer.getvalue())
        return path


def shard_files(folder: Path) -> list[Path]:
    """Return the files of a folder, by the number of their first press."""
    return sorted(path for path in folder.glob("presses-*.npz") if _NAME.fullmatch(path.name))


@dataclass(frozen=True)
class ShardContents:
    """Contents of a file of solved presses, without its arrays."""

    numbers: list[int]
    """Presses that it settles, sorted; all of one specimen."""
    identity: dict[str, Any]
    """Everything that decided the solutions."""


def read_about(path: StrPath) -> ShardContents:
    """Return the contents of a file, without reading its arrays.

    Raises:
        FormatError: If the file is damaged.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream, np.load(stream) as arrays:
            about = json.loads(str(arrays["about"]))
            return ShardContents(sorted([*arrays["number"].tolist(), *map(int, about["failed"])]), about["identity"])
    except (OSError, EOFError, ValueError, KeyError, BadZipFile) as error:
        raise _damaged(path, error) from None


def read_shard(path: StrPath) -> Shard:
    """Read a file.

    Raises:
        FormatError: If it is damaged.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream, np.load(stream) as file:
            arrays = {name: file[name] for name in file.files}
        about = json.loads(str(arrays.pop("about")))
        failed = {int(number): reason for number, reason in about["failed"].items()}
        return Shard(StoredSolutions(arrays, about["identity"]), failed, about["identity"])
    except (OSError, EOFError, ValueError, KeyError, BadZipFile) as error:
        raise _damaged(path, error) from None


class StoredSolutions(Mapping[int, PathSolution]):
    """Solutions of a file, made when they are asked for: in the file's own precision a thousand take 40 MB."""

    def __init__(self, arrays: dict[str, np.ndarray], identity: dict[str, Any]) -> None:
        """Hold a file's arrays.

        Args:
            arrays: Arrays of `Shard.write`.
            identity: Everything that decided the solutions.
        """
        self._identity = identity
        # States of all presses lie one after another.
        stops = np.cumsum(arrays["states"]).tolist()
        parts = zip([0, *stops], stops, strict=False)
        self._places = {n: slice(*part) for n, part in zip(arrays["number"].tolist(), parts, strict=True)}
        self._arrays = {name: values for name, values in arrays.items() if name not in ("number", "states")}

    def __getitem__(self, number: int) -> PathSolution:
        """Return the solution of a press, in double precision."""
        values = {name: stored[self._places[number]].astype(float) for name, stored in self._arrays.items()}
        for name in _GRAINED:
            values[name] *= GRAIN
        return PathSolution(**values, provenance={"made_by": "tacdata.skin", "parents": self._identity})

    def __iter__(self) -> Iterator[int]:
        """Yield the numbers of the presses."""
        return iter(self._places)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._places)


def _joined(parts: list[np.ndarray], dtype: Any) -> np.ndarray:
    return np.concatenate(parts).astype(dtype) if parts else np.zeros(0, dtype)


def _damaged(path: Path, error: Exception) -> FormatError:
    return FormatError(
        f"{path} is damaged: {error}", "a file of solved presses", "remove it and run `tacdata simulate` again"
    )
