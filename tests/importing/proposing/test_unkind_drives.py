"""Drives without a nicety, names that are no text, and texts that grow: the import goes on, or ends in words."""

import errno
import gzip
import os
import shutil

import pytest
from sources import mapping, table, write

from tacdata import documents
from tacdata.commands import check
from tacdata.errors import DeviceError, Exit, FormatError, UsageError, refused_by_system
from tacdata.example import copy_session
from tacdata.importing.formats import csv
from tacdata.importing.imported_session import import_session
from tacdata.recording.session import linked_session, read_session


@pytest.mark.parametrize("call", ("chmod", "fsync"))
def test_a_drive_without_permissions_or_syncs_of_folders_takes_a_whole_session(tmp_path, monkeypatch, call):
    path = write(tmp_path, "csv", table())
    real = getattr(os, call)

    def refused(target, *rest, **options):
        if call == "fsync" and not os.path.isdir(f"/proc/self/fd/{target}"):
            return real(target, *rest, **options)
        raise OSError(errno.EINVAL if call == "fsync" else errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, call, refused)
    assert import_session(tmp_path, mapping(tmp_path, path), tmp_path / "session").recordings == 1


@pytest.mark.parametrize(
    "number", (errno.EFBIG, errno.ESTALE, errno.ENOTCONN, errno.ENOTEMPTY, errno.EROFS, errno.EINVAL)
)
def test_what_a_drive_refuses_is_told_with_its_own_reason(number):
    error = refused_by_system(OSError(number, os.strerror(number), "/mnt/a"))
    assert error is not None and "/mnt/a" in error.given and os.strerror(number) in error.given
    assert "make room" not in error.remedy or number == errno.EFBIG


def test_a_name_that_is_no_text_comes_in(tmp_path):
    path = write(tmp_path, "csv", table())
    os.rename(path, os.fsencode(tmp_path / "run_") + b"\xff.csv")
    files = {"run": {"path": "run_{n}.csv", "time": {"column": "t", "unit": "s"}}}
    made = import_session(tmp_path, mapping(tmp_path, path, files=files), tmp_path / "session")
    assert made.recordings == 1


def test_a_text_that_grows_beyond_the_memory_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(csv, "LARGEST", 1 << 20)
    path = tmp_path / "run.csv.gz"
    path.write_bytes(gzip.compress(b"t,depth,c0,c1\n" + b"1.0,1.0,1.0,1.0\n" * 200_000))
    with pytest.raises(FormatError, match="more than 1 MiB of text"):
        import_session(tmp_path, mapping(tmp_path, path), tmp_path / "session")


def test_a_session_that_may_not_be_written_is_judged_and_its_labels_lie_elsewhere(tmp_path, monkeypatch, capsys):
    kept = copy_session(tmp_path / "drive")
    shutil.rmtree(kept / "labels")
    real = documents.write

    def refused(path, *rest):
        if path.is_relative_to(kept):
            raise DeviceError(f"writing {path} failed", "a folder that may be written", "choose another")
        real(path, *rest)

    monkeypatch.setattr(documents, "write", refused)
    assert check.run(kept).ends == Exit.DONE and "--out names another folder" in "".join(capsys.readouterr())
    before = sorted(kept.iterdir())
    linked = linked_session(read_session(kept), tmp_path / "mine")
    assert [path.resolve() for path in linked.episodes] == [path.resolve() for path in read_session(kept).episodes]
    assert linked.labels == tmp_path / "mine" / "labels" and sorted(kept.iterdir()) == before
    assert linked_session(read_session(kept), tmp_path / "mine").episodes == linked.episodes
    linked.episodes[0].unlink()
    linked.episodes[0].write_bytes(b"another")
    with pytest.raises(UsageError, match="is not the one of"):
        linked_session(read_session(kept), tmp_path / "mine")
