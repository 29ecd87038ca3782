"""Solved presses of one batch in one compact file (NPZ): what episodes are made from, on any machine."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from tacdata.errors import FormatError
from tacdata.labels import PathSolution
from tacdata.replacement import replacement

GRAIN = 1e-4
"""Resolution of stored maps [mm]; 16 bits then reach 3.2 mm, and what is lost is far below the mesh's error."""
_FIELDS = ("taxel_force", "taxel_closure", "taxel_area", "force", "residual", "penetration")
"""Arrays of a solution that are kept in single precision."""
_NAME = re.compile(r"presses-(\d{7})-(\d{7})\.npz")


@dataclass(frozen=True)
class Shard:
    """Solved presses of one specimen, and why others were given up."""

    solutions: Mapping[int, PathSolution]
    """Number of the press -> its solution."""
    failed: Mapping[int, str]
    """Number of the press -> the reason, in words."""
    identity: dict[str, Any]
    """What decided the solutions: hashes of sensor, mesh, settings and code (`SkinModel.identity`)."""

    @property
    def numbers(self) -> list[int]:
        """Presses that are settled, sorted."""
        return sorted([*self.solutions, *self.failed])

    def write(self, folder: Path) -> Path:
        """Write the file into a folder, so that a crash leaves all of it or nothing; return its path."""
        numbers = sorted(self.solutions)
        known = [self.solutions[n] for n in numbers]
        arrays: dict[str, np.ndarray] = {
            "number": np.array(numbers, dtype=np.int64),
            "states": np.array([len(s.depth) for s in known], dtype=np.int64),
            "depth": _joined([s.depth for s in known], float),
            "about": np.array(json.dumps({"identity": self.identity, "failed": dict(self.failed)}, sort_keys=True)),
        }
        for name in ("surface", "numerical"):
            arrays[name] = _joined([np.round(getattr(s, name) / GRAIN) for s in known], np.int16)
        for name in (*_FIELDS, "force_error", "taxel_force_error"):
            arrays[name] = _joined([getattr(s, name) for s in known], np.float32)
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **arrays)  # pyright: ignore[reportArgumentType]
        path = folder / f"presses-{self.numbers[0]:07d}-{len(self.numbers):07d}.npz"
        with replacement(path) as stream:
            stream.write(buffer.getvalue())
        return path


def shard_files(folder: Path) -> list[Path]:
    """Return the files of a folder, by the number of their first press."""
    return sorted(path for path in folder.glob("presses-*.npz") if _NAME.fullmatch(path.name))


@dataclass(frozen=True)
class ShardContents:
    """What a file of solved presses holds, without its arrays."""

    numbers: list[int]
    """Presses that it settles, sorted; all of one specimen."""
    identity: dict[str, Any]
    """What decided the solutions."""


def read_about(path: Path) -> ShardContents:
    """Return what a file holds, without reading its arrays.

    Raises:
        FormatError: If the file is damaged.
    """
    try:
        with np.load(path) as arrays:
            about = json.loads(str(arrays["about"]))
            return ShardContents(sorted([*arrays["number"].tolist(), *map(int, about["failed"])]), about["identity"])
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        raise _damaged(path, error) from None


def read_shard(path: Path) -> Shard:
    """Read a file.

    Raises:
        FormatError: If it is damaged.
    """
    try:
        with np.load(path) as file:
            arrays = {name: file[name] for name in file.files}
        about = json.loads(str(arrays.pop("about")))
        ends = np.cumsum(arrays.pop("states"))[:-1]
        parts = {name: np.split(values, ends) for name, values in arrays.items() if name != "number"}
        numbers = arrays["number"].tolist()
        solutions = {n: _solution({k: v[i] for k, v in parts.items()}, about) for i, n in enumerate(numbers)}
        return Shard(solutions, {int(n): reason for n, reason in about["failed"].items()}, about["identity"])
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        raise _damaged(path, error) from None


def _solution(parts: dict[str, np.ndarray], about: dict[str, Any]) -> PathSolution:
    values = {name: part.astype(float) for name, part in parts.items()}
    for name in ("surface", "numerical"):
        values[name] *= GRAIN
    return PathSolution(**values, provenance={"made_by": "tacdata.skin", "parents": about["identity"]})


def _joined(parts: list[np.ndarray], dtype: Any) -> np.ndarray:
    return np.concatenate(parts).astype(dtype) if parts else np.zeros(0, dtype)


def _damaged(path: Path, error: Exception) -> FormatError:
    return FormatError(
        f"{path} is damaged: {error}", "a file of solved presses", "remove it and run `tacdata simulate` again"
    )
