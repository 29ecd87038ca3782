"""A file takes another's place whole or not at all."""

import errno
import os
import subprocess
import sys

import pytest

from tacdata.replacement import replacement


def test_the_old_file_stays_until_the_new_one_is_whole(tmp_path):
    path = tmp_path / "deep" / "file"
    with replacement(path) as stream:
        stream.write(b"old")
    with replacement(path) as stream:
        stream.write(b"new, and longer")
        stream.flush()
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new, and longer"
    assert [p.name for p in path.parent.iterdir()] == ["file"]
    assert path.stat().st_mode & 0o777 == 0o644


@pytest.mark.parametrize("failing", ["fsync", "replace"])
def test_a_disk_that_refuses_leaves_the_old_file_alone(tmp_path, monkeypatch, failing):
    path = tmp_path / "file"
    path.write_bytes(b"old")

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, failing, full)
    with pytest.raises(OSError, match="No space"), replacement(path) as stream:
        stream.write(b"new")
    monkeypatch.undo()
    assert path.read_bytes() == b"old" and [p.name for p in tmp_path.iterdir()] == ["file"]


def test_what_a_killed_writer_leaves_is_hidden_or_in_the_folder_named(tmp_path):
    """SIGKILL in the middle of the block: the old file stands, the half one bears another name."""
    path, beside = tmp_path / "file", tmp_path / "writing"
    path.write_bytes(b"old")
    beside.mkdir()
    script = (
        "import os, sys\nfrom pathlib import Path\nfrom tacdata.replacement import replacement\n"
        "path, beside = Path(sys.argv[1]), Path(sys.argv[2]) if sys.argv[2] else None\n"
        "with replacement(path, beside) as stream:\n"
        "    stream.write(b'half')\n    stream.flush()\n    os.kill(os.getpid(), 9)\n"
    )
    for where in (None, beside):
        killed = subprocess.run([sys.executable, "-c", script, str(path), str(where or "")], check=False)
        assert killed.returncode == -9 and path.read_bytes() == b"old"
    assert len(list(beside.iterdir())) == 1
    assert [p.name for p in tmp_path.glob("[!.]*")].count("file") == 1
    assert len(list(tmp_path.glob(".file.*"))) == 1
