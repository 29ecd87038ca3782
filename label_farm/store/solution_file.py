"""A path solution as bytes: an npz file with a header (`schemas/path_solution.schema.json`) and checksums."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
import zlib
from typing import Any

import numpy as np

from tacdata import documents, schemas
from tacdata.errors import FormatError
from tacdata.label_farm.presses.job import Job
from tacdata.labels import PathSolution
from tacdata.labels.columns import PATH, PATH_OPTIONAL, PATH_REQUIRED

HEADER = "header.json"
PACKED = tuple(f"{name}.npy" for name, quantity in PATH.items() if quantity.sparse)
"""Members that are compressed."""
REMEDY = "remove it and run `tacdata label` again: results can always be made anew"
EPOCH = (1980, 1, 1, 0, 0, 0)


class SolutionVersionError(FormatError):
    """A result was written by a release with another major version of the format; it is not damaged."""


def encode(job: Job, solution: PathSolution) -> bytes:
    """Return the file's bytes; the same arrays give the same members whenever they are written."""
    members, arrays = {}, {}
    for name, quantity in PATH.items():
        if name in PATH_OPTIONAL and getattr(solution, name) is None:
            continue
        values = np.ascontiguousarray(getattr(solution, name), dtype=np.float64)
        stream = io.BytesIO()
        np.save(stream, values, allow_pickle=False)
        members[f"{name}.npy"] = stream.getvalue()
        digest = hashlib.sha256(stream.getvalue()).hexdigest()
        arrays[name] = {"unit": quantity.unit, "dtype": "float64", "shape": list(values.shape), "sha256": digest}
    header = {
        "version": schemas.version("path_solution"),
        "key": job.key,
        "job": job.document,
        "arrays": arrays,
        "provenance": solution.provenance,
    }
    documents.check(header, "path_solution", f"result {job.key[:12]}")
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        text = json.dumps(header, indent=1, allow_nan=False).encode()
        for name, content in {HEADER: text, **members}.items():
            # Digits of maps hardly shrink, and trying cost more than all other steps here. A pressure is 0 outside
            # the contact: it shrinks to a tenth.
            kind = zipfile.ZIP_DEFLATED if name in PACKED else zipfile.ZIP_STORED
            # A fixed date, the earliest of the ZIP format: equal content gives equal bytes.
            archive.writestr(zipfile.ZipInfo(name, EPOCH), content, kind, compresslevel=1)
    return stream.getvalue()


def decode(data: bytes, origin: str) -> tuple[Job, PathSolution]:
    """Read a file's bytes back, checking every array against its checksum.

    Raises:
        FormatError: If the file is damaged, or of another format version.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            header = json.loads(archive.read(HEADER))
            _check_version(header, origin)
            documents.check(header, "path_solution", origin)
            names = [*PATH_REQUIRED, *(name for name in PATH_OPTIONAL if name in header["arrays"])]
            arrays = {name: _array(archive, name, header["arrays"][name], origin) for name in names}
    except (
        zipfile.BadZipFile,
        zlib.error,
        KeyError,
        TypeError,
        ValueError,
        EOFError,
        NotImplementedError,
        RuntimeError,
    ) as error:
        raise FormatError(f"{origin} is damaged: {error}", "a result of the label store", REMEDY) from None
    job = Job.from_document(header["job"], origin)
    if job.key != header["key"]:
        raise FormatError(f"{origin}: its job has the key {job.key[:12]}…", f"{header['key'][:12]}…", REMEDY)
    return job, PathSolution(**arrays, provenance={**header["provenance"], "key": job.key})


def _check_version(header: Any, origin: str) -> None:
    version, supported = str(header["version"]), schemas.version("path_solution")
    if version.split(".")[0] != supported.split(".")[0]:
        raise SolutionVersionError(
            f"{origin}: result of format version {version}",
            f"version {supported}",
            "use the tacdata release that wrote it, or name a new folder with --store",
        )


def _array(archive: zipfile.ZipFile, name: str, entry: dict[str, Any], origin: str) -> np.ndarray:
    content = archive.read(f"{name}.npy")
    if hashlib.sha256(content).hexdigest() != entry["sha256"]:
        raise FormatError(f"{origin}: {name} does not match its checksum", "an undamaged result", REMEDY)
    values = np.load(io.BytesIO(content), allow_pickle=False)
    if list(values.shape) != entry["shape"] or str(values.dtype) != entry["dtype"]:
        raise FormatError(
            f"{origin}: {name} is {values.dtype} {values.shape}", f"{entry['dtype']} {tuple(entry['shape'])}", REMEDY
        )
    return values
