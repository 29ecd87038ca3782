"""A set by name: from a mirror on this computer, compared with its hashes; nothing of a person is replaced."""

import functools
import hashlib
import threading
import zipfile
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest
import yaml
from running.in_process import tacdata

from tacdata import documents
from tacdata.errors import Exit
from tacdata.example import fetched
from tacdata.importing.mapping import Mapping

CONTENT = b'{"data": [[0.0, 1.0]]}'


class Counting(SimpleHTTPRequestHandler):
    asked: list

    def do_GET(self):
        self.asked.append(self.path)
        super().do_GET()

    def log_message(self, *_):
        pass


@pytest.fixture
def mirror(tmp_path, monkeypatch):
    """A mirror of two sets, as address and folder, and what was asked of it."""
    folder, records = tmp_path / "mirror", tmp_path / "records"
    for each in (folder / "machine", folder / "presses", records):
        each.mkdir(parents=True)
    (folder / "machine" / "run.json").write_bytes(CONTENT)
    with zipfile.ZipFile(folder / "presses" / "presses.zip", "w") as archive:
        archive.writestr("session.json", "{}")
    digest = hashlib.sha256((folder / "presses" / "presses.zip").read_bytes()).hexdigest()
    (folder / "presses" / "registry.txt").write_text(f"presses.zip sha256:{digest}\n")
    described = {"meaning": "a machine", "source": "A. Nobody", "licence": "CC0", "mapping": "map.yaml"}
    files = {"run.json": {"path": "x/run.json", "sha256": hashlib.sha256(CONTENT).hexdigest()}}
    machine = {**described, "address": "http://origin.invalid", "files": files}
    presses = {"meaning": "presses", "source": "a release", "licence": "MIT", "archive": "presses.zip"}
    (records / "sets.yaml").write_text(yaml.safe_dump({"machine": machine, "presses": presses}))
    (records / "map.yaml").write_text("name: machine\n")
    monkeypatch.setattr(fetched, "HERE", records)
    handler = type("Counted", (Counting,), {"asked": []})
    with ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(handler, directory=folder)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}", folder, handler.asked
        server.shutdown()


def test_a_set_comes_with_its_source_and_mapping_and_is_not_asked_for_twice(mirror, tmp_path):
    address, _, asked = mirror
    for _ in range(2):
        done = tacdata("fetch", "machine", "--mirror", address, folder=tmp_path)
        assert done.returncode == Exit.DONE, done.stderr
    assert asked == ["/machine/run.json"]
    assert done.stdout.endswith("next: tacdata import machine --mapping machine/mapping.yaml --out machine-session\n")
    folder = tmp_path / "machine"
    assert (folder / "run.json").read_bytes() == CONTENT
    assert (folder / "mapping.yaml").read_text() == "name: machine\n"
    told = (folder / "SOURCE.txt").read_text()
    assert "A. Nobody" in told and "Licence: CC0" in told and "http://origin.invalid/x/run.json" in told


def test_a_release_is_unpacked_once(mirror, tmp_path, monkeypatch):
    address, _, asked = mirror
    monkeypatch.setenv("TACDATA_MIRROR", address)
    for _ in range(2):
        done = tacdata("fetch", "presses", "--out", "data", folder=tmp_path)
        assert done.returncode == Exit.DONE, done.stderr
    assert asked == ["/presses/registry.txt", "/presses/presses.zip"]
    assert [path.name for path in sorted((tmp_path / "data").rglob("*"))] == ["presses", "session.json"]
    assert "next: tacdata check data/presses" in done.stdout


@pytest.mark.parametrize("name", ["machine/run.json", "presses/presses.zip"])
def test_another_hash_is_refused_and_leaves_nothing(mirror, tmp_path, name):
    address, folder, _ = mirror
    (folder / name).write_bytes(b"changed")
    done = tacdata("fetch", name.split("/")[0], "--mirror", address, "--out", "new", folder=tmp_path)
    assert done.returncode == Exit.FORMAT and "has another hash" in done.stderr
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("name", ["machine", "presses"])
def test_a_folder_here_is_a_mirror_by_its_path_or_its_address(mirror, tmp_path, name):
    folder = mirror[1]
    for number, spelled in enumerate((str(folder), folder.as_uri())):
        done = tacdata("fetch", name, "--mirror", spelled, "--out", f"new{number}", folder=tmp_path)
        assert done.returncode == Exit.DONE, done.stderr
        assert list((tmp_path / f"new{number}").rglob("run.json" if name == "machine" else "session.json"))
    assert not mirror[2]  # nothing goes over the network


def test_a_file_of_the_person_stays(mirror, tmp_path):
    (tmp_path / "machine").mkdir()
    (tmp_path / "machine" / "run.json").write_text("mine")
    done = tacdata("fetch", "machine", "--mirror", mirror[0], folder=tmp_path)
    assert done.returncode == Exit.USAGE and "has another content" in done.stderr
    assert (tmp_path / "machine" / "run.json").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (("machin",), Exit.USAGE, "allowed: machine, presses"),
        (("machine", "--mirror", "{}/nowhere"), Exit.DEVICE, "status 404"),
        (("machine", "--mirror", "nowhere"), Exit.USAGE, "nowhere/machine/run.json"),
        (("machine", "--mirror", "file:///nowhere"), Exit.USAGE, "no file /nowhere/machine/run.json"),
        (("machine", "--mirror", "gopher://nowhere"), Exit.USAGE, "is no address"),
    ],
)
def test_what_cannot_be_fetched_is_answered_in_words(mirror, tmp_path, words, code, told):
    done = tacdata("fetch", *(word.format(mirror[0]) for word in words), folder=tmp_path)
    assert done.returncode == code and told in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "machine").exists()


def test_a_verb_alone_lists_the_sets_with_licence_and_each_record_is_complete():
    done = tacdata("fetch")
    for name, record in fetched.published_sets().items():
        assert name in done.stdout and record["licence"] in done.stdout and record["source"] in done.stdout
        assert all(len(file["sha256"]) == 64 for file in record.get("files", {}).values())
        if "mapping" in record:
            Mapping.from_document(documents.read(fetched.HERE / record["mapping"], "import_mapping"), fetched.HERE)
