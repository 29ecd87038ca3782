"""`tacdata farm`: what is wrong is said in words, with the exit code of its kind."""

import sys

import pytest

from label_farm import environment
from tacdata import cli, registry
from tacdata.errors import UsageError

NOWHERE = "http://127.0.0.1:9"
CASES = [
    ("status", f"--url {NOWHERE}", "no answer from", 4),
    ("status", "--wait", "--wait without a submission", 2),
    ("submit", f"session --url {NOWHERE}", "start it: `tacdata farm up`", 4),
    ("submit", "session --url ftp://host", "http://HOST:PORT", 2),
    ("cancel", f"000001 --url {NOWHERE}", "no answer from", 4),
    ("priority", f"000001 5 --url {NOWHERE}", "no answer from", 4),
    ("worker", NOWHERE, "no answer from", 4),
    ("worker", "nonsense", "http://HOST:PORT", 2),
    ("worker", "tcp://127.0.0.1:9 --device gpu", "cuda for all cards", 2),
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
    assert environment.devices(()) == ("cpu",)
    assert environment.devices(("cuda:1", "cpu")) == ("cuda:1", "cpu")
    monkeypatch.setattr(environment, "_cards", lambda: ["cuda:0", "cuda:1"])
    assert environment.devices(("cuda",)) == ("cuda:0", "cuda:1")
    monkeypatch.setattr(environment, "_cards", lambda: [])
    with pytest.raises(UsageError, match="lists no card"):
        environment.devices(("cuda",))
    with pytest.raises(UsageError, match="cuda for all cards"):
        environment.devices(("gpu0",))


def test_a_worker_sees_its_own_card_alone(monkeypatch):
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    assert environment.variables("cpu")[environment.DEVICE] == "cpu"
    given = environment.variables("cuda:1")
    assert (given["CUDA_VISIBLE_DEVICES"], given[environment.DEVICE]) == ("1", "cuda:0")
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "4,6")
    assert environment.variables("cuda:1")["CUDA_VISIBLE_DEVICES"] == "6"
