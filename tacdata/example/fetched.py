"""Sets of data by name: fetched from their authors or from a release, and compared with their hashes."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from urllib.request import url2pathname

import yaml

from tacdata.errors import DeviceError, FormatError, UsageError

HERE = Path(__file__).parent
HASHES = "registry.txt"
"""Hashes of a release's files, a line each, as pooch reads them."""
MAPPING, SOURCE = "mapping.yaml", "SOURCE.txt"


def published_sets() -> dict[str, dict[str, Any]]:
    """Return the records of all sets by name (`sets.yaml`)."""
    return yaml.safe_load((HERE / "sets.yaml").read_text(encoding="utf-8"))


def fetch(name: str, folder: Path, mirror: str = "") -> Path:
    """Fetch a set into a folder. Files that it has already are not fetched again.

    Args:
        name: Name of the set.
        folder: Folder for its files; made if there is none.
        mirror: Address or local folder with a folder of the set's name, in place of the origin.

    Returns:
        The folder of its recordings.

    Raises:
        UsageError: If there is no such set, or the folder has another file of the same name.
        FormatError: If a file has another hash than its record.
        DeviceError: If its origin does not answer, or the disk refuses it.
    """
    sets = published_sets()
    if name not in sets:
        raise UsageError(f"no set {name}", ", ".join(sets), "tacdata fetch lists them")
    if mirror and "://" not in mirror:
        mirror = Path(mirror).resolve().as_uri()
    with _nothing_left(folder):
        return _all_of(name, sets[name], folder, mirror)


@contextmanager
def _nothing_left(folder: Path) -> Iterator[None]:
    """Remove the folders that a failed fetch made and left empty."""
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    try:
        yield
    except Exception:
        with suppress(OSError):  # one that is not empty stays, and so do those above it
            for each in made:
                each.rmdir()
        raise


def _all_of(name: str, record: dict[str, Any], folder: Path, mirror: str) -> Path:
    """Fetch all files of a set, and write its mapping and its source beside them; return the folder of recordings."""
    if archive := record.get("archive"):
        return _unpacked(folder, archive, f"{mirror.rstrip('/')}/{name}" if mirror else _release())
    files = record["files"]
    hashes = {file: f"sha256:{described['sha256']}" for file, described in files.items()}
    origin = {file: f"{record['address']}/{described['path']}" for file, described in files.items()}
    addresses = {file: f"{mirror.rstrip('/')}/{name}/{file}" for file in files} if mirror else origin
    for file, known in hashes.items():
        _fetched(folder, file, known, addresses[file])
    shutil.copyfile(HERE / record["mapping"], folder / MAPPING)
    words = [record["meaning"], record["source"], f"Licence: {record['licence']}. The files are unchanged.", ""]
    lines = [f"{hashes[file]}  {file}  {origin[file]}" for file in files]
    (folder / SOURCE).write_text("\n".join([*words, *lines, ""]), encoding="utf-8")
    return folder


def _unpacked(folder: Path, archive: str, address: str) -> Path:
    """Fetch an archive of a release and unpack it; return the folder of its name."""
    target = folder / Path(archive).stem
    if target.exists():
        return target
    listed = _fetched(folder, HASHES, None, f"{address}/{HASHES}")
    hashes = dict(line.split() for line in listed.read_text(encoding="utf-8").splitlines())
    listed.unlink()
    if archive not in hashes:
        raise FormatError(f"{HASHES} at {address} lacks {archive}", "a line for it", "try a newer release")
    path = _fetched(folder, archive, hashes[archive], f"{address}/{archive}")
    unpacked = target.with_suffix(".part")
    shutil.rmtree(unpacked, ignore_errors=True)
    with zipfile.ZipFile(path) as content:
        content.extractall(unpacked)
    unpacked.rename(target)
    path.unlink()
    return target


def _fetched(folder: Path, file: str, known: str | None, address: str) -> Path:
    """Return a file of the folder, fetched if it is missing."""
    import pooch

    path = folder / file
    if path.exists() and known and pooch.file_hash(str(path)) != known.removeprefix("sha256:"):
        raise UsageError(
            f"{path} has another content", "the set's own file, or none", "move it, or choose another --out"
        )
    pooch.get_logger().setLevel("ERROR")
    try:
        pooch.retrieve(address, known, fname=file, path=folder, downloader=_copy if _is_local(address) else None)
    except OSError as error:
        if _is_local(address) and isinstance(error, FileNotFoundError):
            raise UsageError(
                f"no file {error.filename}", "a folder NAME/ with the set's files", "correct --mirror"
            ) from None
        if not hasattr(error, "response"):  # of the disk, not of requests
            raise
        status = getattr(error.response, "status_code", None)
        reason = f"status {status}" if status else type(error).__name__
        raise DeviceError(
            f"{address} does not answer: {reason}",
            "an address that this computer reaches",
            "check the network; a mirror is named by --mirror ADDRESS or TACDATA_MIRROR",
        ) from None
    except ValueError as error:
        if known is None or known.removeprefix("sha256:") not in str(error):
            raise UsageError(
                f"{address} is no address", "http://HOST/FOLDER, or a folder here", "correct --mirror"
            ) from None
        raise FormatError(
            f"{address} has another hash than {known}", "the file that was published", "try again, or another mirror"
        ) from None
    path.chmod(0o644)  # pooch gives it to its owner alone
    return path


def _is_local(address: str) -> bool:
    return address.startswith("file:")


def _copy(fname: str, action: Any, pooch: Any, *, check_only: bool | None = None) -> None:
    """Copy a file of this computer, as a downloader of pooch: its own ones go over a network."""
    shutil.copyfile(url2pathname(urlsplit(fname).path), action)


def _release() -> str:
    """Return the address of the newest release's files."""
    try:
        addresses = metadata("tacdata").get_all("Project-URL") or []
    except PackageNotFoundError:
        addresses = []
    for line in addresses:
        label, _, address = line.partition(", ")
        if label == "Source":
            return f"{address}/releases/latest/download"
    raise UsageError(
        "this install knows no address of a release: it was made from a clone without a remote",
        "an install from a release, or a mirror",
        "--mirror ADDRESS, or record presses: tacdata virtual-rig",
    )
