"""Bad input ends in words and an exit code: never in a traceback, and with every file as it was."""

import errno
import hashlib
import sys

import pytest
import yaml

from tacdata import cli, registry
from tacdata.sensor import default_sensor

VERBS = registry.names(cli.ROOM, cli.BASE)


@pytest.fixture
def folder(tmp_path):
    """A folder with everything that a person might mistake for something else."""
    (tmp_path / "empty").mkdir()
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "mine.txt").write_text("three weeks of work")
    (tmp_path / "words.txt").write_text("not what you think")
    (tmp_path / "words.mcap").write_text("not a recording")
    (tmp_path / "words.safetensors").write_text("not a network")
    (tmp_path / "cut.mcap").write_bytes(b"\x89MCAP0\r\n\x01\x10")
    (tmp_path / "taken.rrd").write_text("a picture of mine")
    (tmp_path / "broken.yaml").write_text("version: [")
    document = default_sensor().document
    document["skin"]["thickness"] = -3.3
    (tmp_path / "thin.yaml").write_text(yaml.safe_dump(document))
    plan = {
        "version": "1.0",
        "name": "too deep",
        "indenters": {"ball": {"shape": "sphere", "radius": 2.0}},
        "motion": {
            "clearance": 2.0,
            "travel_speed": 10.0,
            "approach_speed": 2.0,
            "press_speed": 1.0,
            "hold": 0.5,
            "rest": 0.5,
        },
        "presses": [{"indenter": "ball", "x": 0.0, "y": 0.0, "depth": 4.0}],
    }
    (tmp_path / "deep.yaml").write_text(yaml.safe_dump(plan))
    plan["presses"][0]["depth"] = 1.0
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(plan))
    plan["indenters"]["ball"]["shape"] = "spheer"
    (tmp_path / "typo.yaml").write_text(yaml.safe_dump(plan))
    rig = {
        "version": "1.0",
        "name": "unplugged",
        "cnc": {"driver": "grbl", "port": str(tmp_path / "no-port")},
        "board": {"driver": "capacitive_board", "port": str(tmp_path / "no-port-2")},
        "registration": {"origin": [0.0, 0.0, 0.0], "yaw": 0.0},
        "envelope": {"min": [-20.0, -20.0, -10.0], "max": [20.0, 20.0, 20.0]},
    }
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig))
    (tmp_path / "no-driver.yaml").write_text(yaml.safe_dump({**rig, "cnc": {"driver": "gbrl", "port": "x"}}))
    return tmp_path


def contents(folder):
    return {p: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.rglob("*") if p.is_file()}


# The verb and its arguments, a word that the message must hold, and the exit codes that fit.
CASES = [
    ("list", "indenter", "indenters", {2}),
    ("record", "--rig nothing.yaml --plan plan.yaml --out new --yes", "nothing.yaml", {2}),
    ("record", "--rig broken.yaml --plan plan.yaml --out new --yes", "broken.yaml", {3}),
    ("record", "--rig rig.yaml --plan broken.yaml --out new --yes", "broken.yaml", {3}),
    ("record", "--rig rig.yaml --plan plan.yaml --out new --yes", "no-port", {4}),
    ("record", "--rig no-driver.yaml --plan plan.yaml --out new --yes", "did you mean 'grbl'", {2}),
    ("record", "--rig rig.yaml --plan typo.yaml --out new --yes", "did you mean 'sphere'", {2}),
    ("record", "--rig rig.yaml --plan deep.yaml --out new --yes", "3.3 mm", {3}),
    ("record", "--rig rig.yaml --plan plan.yaml --out new --yes --sensor thin.yaml", "thickness", {3}),
    ("record", "--rig rig.yaml --plan plan.yaml --out taken --yes", "taken", {2}),
    ("plan", "--out plan.yaml", "plan.yaml", {2}),
    ("plan", "training", "nowhere to write", {2}),
    ("plan", "trainin --out new.yaml", "did you mean 'training'", {2}),
    ("plan", "deep.yaml", "3.3 mm", {3}),
    ("plan", "broken.yaml --out new.yaml", "broken.yaml", {3}),
    ("register", "--rig nothing.yaml --yes", "nothing.yaml", {2}),
    ("register", "--rig rig.yaml --yes", "no-port", {4}),
    ("register", "--rig rig.yaml --yes --out plan.yaml", "plan.yaml", {2}),
    ("import", "nothing", "nothing", {2}),
    ("import", "empty", "empty", {2}),
    ("import", "taken --mapping nothing.yaml --out new", "nothing.yaml", {2}),
    ("import", "taken --mapping broken.yaml --out new", "broken.yaml", {3}),
    ("import", "taken --mapping plan.yaml --out new", "plan.yaml", {3}),
    ("import", "taken --mapping plan.yaml", "--out", {2}),
    ("plan", "--out new.yaml --indenter hammer", "hammer", {2}),
    ("check", "nothing", "nothing", {2}),
    ("check", "empty", "empty", {2, 3}),
    ("check", "words.mcap", "words.mcap", {2, 3}),
    ("recover", "nothing.mcap", "nothing.mcap", {2}),
    ("recover", "words.mcap", "words.mcap", {1}),
    ("label", "nothing", "nothing", {2}),
    ("label", "empty", "empty", {2, 3}),
    ("pack", "nothing --out new", "nothing", {2}),
    ("pack", "empty --out taken", "taken", {2}),
    ("train", "nothing --out new", "nothing", {2}),
    ("train", "empty --out new", "empty", {2, 3}),
    ("train", "empty --out taken", "empty", {2, 3}),
    ("evaluate", "nothing", "nothing", {2}),
    ("evaluate", "words.safetensors", "words.safetensors", {3}),
    ("protocols", "nothing", "nothing", {2}),
    ("protocols", "empty --out taken", "taken", {2}),
    ("protocols", "empty --network words.safetensors", "words.safetensors", {3}),
    ("generalize", "nothing --out new", "nothing", {2}),
    ("generalize", "empty --out new --split indentr", "did you mean 'indenter'", {2}),
    ("generalize", "empty --out words.txt", "words.txt", {2}),
    ("report", "nothing --out new.html", "nothing", {2}),
    ("report", "empty --out words.txt", "words.txt", {2}),
    ("card", "nothing", "nothing", {2}),
    ("card", "empty --out taken", "taken", {2}),
    ("export-network", "nothing --out new.onnx", "nothing", {2}),
    ("success", "nothing.csv", "nothing.csv", {2}),
    ("success", "words.txt", "condition", {3}),
    ("success", "dense=50/40", "50 successes", {2}),
    ("view", "nothing --save new.rrd", "nothing", {2}),
    ("view", "words.mcap --save new.rrd", "words.mcap", {2, 3}),
    ("view", "words.txt --save new.rrd", "words.txt", {2, 3}),
    ("view", "words.mcap --save taken.rrd", "taken.rrd", {2}),
    ("demo", "--out words.txt/demo", "words.txt", {2}),
    ("discrepancy", "nothing --out new", "nothing", {2}),
    ("discrepancy", "empty --out new", "empty", {2, 3}),
    ("discrepancy", "words.mcap --out new", "words.mcap", {2, 3}),
    ("discrepancy", "words.mcap --out taken", "taken", {2}),
    ("discrepancy", "words.mcap --out new --spec broken.yaml", "broken.yaml", {3}),
    ("discrepancy", "words.mcap --out new --spec plan.yaml", "plan.yaml", {3}),
]


@pytest.mark.parametrize(("verb", "line", "word", "codes"), CASES, ids=[f"{c[0]} {c[1]}" for c in CASES])
def test_bad_input_ends_in_words(verb, line, word, codes, folder, monkeypatch, capfd):
    before = contents(folder)
    code, shown = run(folder, monkeypatch, capfd, [verb, *line.split()])
    assert code in codes, shown
    assert word in shown
    assert "allowed:" in shown
    assert "next:" in shown
    assert "Traceback" not in shown
    assert contents(folder) == before


@pytest.mark.parametrize("verb", [name.replace("_", "-") for name in VERBS])
def test_an_unknown_option_ends_in_words(verb, folder, monkeypatch, capfd):
    code, shown = run(folder, monkeypatch, capfd, [verb, "--no-such-option"])
    assert code == 2
    assert "Traceback" not in shown


def run(folder, monkeypatch, capfd, arguments):
    """Run `tacdata ARGUMENTS` in a folder; return its exit code and what it wrote to stderr."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "argv", ["tacdata", *arguments])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    return caught.value.code, capfd.readouterr().err


@pytest.mark.parametrize(
    ("number", "words"),
    [(errno.EACCES, "permissions"), (errno.EROFS, "read-only"), (errno.ENOSPC, "make room"), (errno.EDQUOT, "quota")],
)
def test_what_the_system_refuses_a_file_for_is_said_in_words(number, words, monkeypatch, capfd):
    """Any verb, at any write: one place answers for all."""

    def full(*_):
        raise OSError(number, "no", "/data/page.png")

    monkeypatch.setattr("tacdata.plans.read_plan", full)
    monkeypatch.setattr("tacdata.documents.content_of", full)
    monkeypatch.setattr(sys, "argv", ["tacdata", "plan", __file__])
    with pytest.raises(SystemExit) as end:
        cli.main()
    said = capfd.readouterr().err
    assert end.value.code == 4
    assert "/data/page.png: no" in said and words in said and "Traceback" not in said


def test_a_picture_below_a_file_ends_in_words(folder, monkeypatch, capfd):
    target = folder / "words.txt" / "page.png"
    monkeypatch.setattr(sys, "argv", ["tacdata", "plan", str(folder / "plan.yaml"), "--picture", str(target)])
    with pytest.raises(SystemExit) as end:
        cli.main()
    said = capfd.readouterr().err
    assert end.value.code not in (0, 1) and "words.txt" in said and "Traceback" not in said
    assert (folder / "words.txt").read_text() == "not what you think"
