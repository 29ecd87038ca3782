"""`tacdata farm`: what is wrong is said in words, with the exit code of its kind."""

import socket
import sys
import threading

import pytest

from tacdata import cli, registry
from tacdata.errors import UsageError
from tacdata.label_farm import environment

NOWHERE = "http://127.0.0.1:9"
CASES = [
    ("status", f"--url {NOWHERE}", "no answer from", 4),
    ("status", "--wait", "--wait without a submission", 2),
    ("submit", f"session --url {NOWHERE}", "start it: `tacdata farm up`", 4),
    ("submit", "session --url ftp://host", "http://HOST:PORT", 2),
    ("submit", "session --url http://host:port", "http://HOST:PORT", 2),
    ("submit", "session --url http://[::1", "http://HOST:PORT", 2),
    ("status", "é", "its number, such as 000001", 2),
    ("status", "../x", "its number, such as 000001", 2),
    ("status", f"1 --url {NOWHERE} --token ä€", "a token with", 2),
    ("cancel", "1234567", "its number, such as 000001", 2),
    ("cancel", f"000001 --url {NOWHERE}", "no answer from", 4),
    ("fetch", f"000001 nothing --url {NOWHERE}", "no answer from", 4),
    ("priority", f"000001 5 --url {NOWHERE}", "no answer from", 4),
    ("worker", NOWHERE, "no answer from", 4),
    ("worker", "nonsense", "http://HOST:PORT", 2),
    ("worker", "tcp://127.0.0.1:9 --device gpu", "cuda for all GPUs", 2),
    ("dataset", "nothing", "nothing", 2),
    ("up", "--host 0.0.0.0", "without a token", 2),
    ("up", "--root nothing", "no folder nothing", 2),
    ("up", "--dask there --port 0", "tcp://HOST:PORT", 2),
]


def run(folder, monkeypatch, capfd, words):
    monkeypatch.chdir(folder)
    monkeypatch.delenv("TACDATA_FARM_TOKEN", raising=False)
    monkeypatch.setattr(sys, "argv", ["tacdata", *words])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    return caught.value.code, capfd.readouterr()


@pytest.mark.parametrize(("verb", "line", "word", "code"), CASES, ids=[f"{c[0]} {c[1]}" for c in CASES])
def test_bad_input_ends_in_words(tmp_path, monkeypatch, capfd, verb, line, word, code):
    found, shown = run(tmp_path, monkeypatch, capfd, ["farm", verb, *line.split()])
    assert found == code, shown.err
    assert word in shown.err and "allowed:" in shown.err and "next:" in shown.err and "Traceback" not in shown.err
    assert not list(tmp_path.glob("*")), "nothing is made"


def test_every_file_of_the_folder_is_a_verb_with_help(tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("COLUMNS", "200")
    _, shown = run(tmp_path, monkeypatch, capfd, ["farm", "--help"])
    verbs = registry.names("tacdata.commands.farm", "command")
    assert {"up", "submit", "status", "cancel", "worker", "dataset"} <= set(verbs)
    for verb in verbs:
        assert f" {verb} " in shown.out
        module = registry.load_module("tacdata.commands.farm", "command", verb)
        assert isinstance(module.ORDER, int) and module.run.__doc__


def test_devices_are_those_that_are_there(monkeypatch):
    monkeypatch.setattr(environment, "_gpus", lambda: ["cuda:0", "cuda:1"])
    assert environment.devices(()) == ("cpu",)
    assert environment.devices(("cuda:1", "cpu")) == ("cuda:1", "cpu")
    assert environment.devices(("cuda",)) == ("cuda:0", "cuda:1")
    with pytest.raises(UsageError, match="has cuda:0, cuda:1"):
        environment.devices(("cuda:2",))
    monkeypatch.setattr(environment, "_gpus", lambda: [])
    for name in ("cuda", "cuda:0"):
        with pytest.raises(UsageError, match="no CUDA GPU"):
            environment.devices((name,))
    with pytest.raises(UsageError, match="'gpu0'") as error:
        environment.devices(("gpu0",))
    assert "cuda for all GPUs" in error.value.allowed


def test_cards_are_counted_by_the_driver_where_nvidia_smi_is_missing(monkeypatch):
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    monkeypatch.setattr(environment, "_listed", lambda: 0)
    monkeypatch.setattr(environment, "_counted", lambda: 3)
    assert environment._gpus() == ["cuda:0", "cuda:1", "cuda:2"]
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "4,6")
    assert environment._gpus() == ["cuda:0", "cuda:1"]


def test_cards_that_lie_idle_are_named_unless_a_device_was_chosen(monkeypatch):
    monkeypatch.setattr(environment, "_gpus", lambda: ["cuda:0", "cuda:1"])
    assert "2 CUDA GPUs" in environment.idle_gpus(()) and "--device cuda" in environment.idle_gpus(())
    assert environment.idle_gpus(("cpu",)) == ""
    monkeypatch.setattr(environment, "_gpus", lambda: [])
    assert environment.idle_gpus(()) == ""


def test_a_worker_sees_its_own_card_alone(monkeypatch):
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    assert environment.variables("cpu")[environment.DEVICE] == "cpu"
    given = environment.variables("cuda:1")
    assert (given["CUDA_VISIBLE_DEVICES"], given[environment.DEVICE]) == ("1", "cuda:0")
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "4,6")
    assert environment.variables("cuda:1")["CUDA_VISIBLE_DEVICES"] == "6"


@pytest.mark.parametrize(
    ("answer", "code", "word"),
    [
        (b"SSH-2.0-OpenSSH_9.2\r\n", 4, "no answer from"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: 900\r\n\r\n{", 4, "no answer from"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: 6\r\n\r\n<html>", 2, "is no label farm"),
        (b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n", 2, "is no label farm"),
    ],
)
def test_what_is_no_farm_is_named(tmp_path, monkeypatch, capfd, answer, code, word):
    """Whatever listens at the address: another protocol, an answer that breaks off, another web server."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve():
            line, _ = listener.accept()
            with line:
                line.recv(65536)
                line.sendall(answer)

        thread = threading.Thread(target=serve)
        thread.start()
        url = f"http://127.0.0.1:{listener.getsockname()[1]}"
        found, shown = run(tmp_path, monkeypatch, capfd, ["farm", "status", "--url", url])
        thread.join()
    assert found == code and word in shown.err and "next:" in shown.err and "Traceback" not in shown.err
