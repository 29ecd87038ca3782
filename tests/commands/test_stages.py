"""Stages stop at the first failure with its exit code, and an interrupted one closes its files first."""

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import redirect_stdout

import pytest

from tacdata import stages
from tacdata.errors import DeviceError

PATIENT = """
import signal, sys, time
from pathlib import Path
folder = Path(sys.argv[1])
try:
    (folder / "started").touch()
    time.sleep(300)
except KeyboardInterrupt:
    time.sleep(0.2)
    (folder / "closed").write_text("once")
    time.sleep(0.2)
    sys.exit(130)
"""

RUNNER = """
import sys
from tacdata import stages
stages.command_line = lambda arguments: [sys.executable, "-c", *arguments]
stages.Line(1, "").run("a", ["from tacdata import stages; stages.follow()" + sys.argv[1], sys.argv[2]])
"""
"""A program that runs another as a stage."""


@pytest.fixture
def scripts(monkeypatch):
    """Stages are Python scripts instead of verbs: the first argument is the program's text."""
    monkeypatch.setattr(stages, "command_line", lambda arguments: [sys.executable, "-c", *arguments])


def wait_for(condition, seconds=60.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.01)


def test_stages_run_in_order_and_print_what_would_be_typed(scripts, tmp_path, capfd):
    program = "import sys; open(sys.argv[1], 'a').write(sys.argv[2])"
    line = stages.Line(2, "")
    line.run("first", [program, str(tmp_path / "x"), "a"])
    line.run("second", [program, str(tmp_path / "x"), "b"])
    assert (tmp_path / "x").read_text() == "ab"
    shown = capfd.readouterr().out
    assert "[1/2] first" in shown
    assert "[2/2] second" in shown
    assert shown.count("$ tacdata ") == 2


def test_words_of_a_stage_stay_out_of_a_result(scripts, capfd):
    """With ``--json`` only the result goes to standard output."""
    with redirect_stdout(sys.stderr):
        stages.Line(1, "").run("a", ["print('from the stage')"])
    shown = capfd.readouterr()
    assert shown.out == "" and "from the stage" in shown.err


def test_a_failure_carries_the_exit_code_of_its_verb(scripts):
    with pytest.raises(stages.StageError) as caught:
        stages.Line(3, "nothing is lost").run("a", ["raise SystemExit(3)"])
    assert caught.value.exit_code == 3
    assert "stage 1" in str(caught.value)
    assert "nothing is lost" in str(caught.value)


def test_a_tolerated_exit_code_is_shown_and_passed_over(scripts, capfd):
    stages.Line(1, "").run("a", ["raise SystemExit(5)"], tolerated=5)
    assert "exit code 5: going on" in capfd.readouterr().out
    with pytest.raises(stages.StageError):
        stages.Line(1, "").run("a", ["raise SystemExit(4)"], tolerated=5)


def test_a_verb_killed_by_a_signal_counts_as_failed(scripts):
    with pytest.raises(stages.StageError) as caught:
        stages.Line(1, "").run("a", ["import os; os.kill(os.getpid(), 9)"])
    assert caught.value.exit_code == 1


def test_an_interrupt_waits_until_the_stage_has_closed_its_files(scripts, tmp_path):
    def interrupt():
        while not (tmp_path / "started").exists():
            time.sleep(0.01)
        time.sleep(0.1)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        stages.Line(1, "").run("a", [PATIENT, str(tmp_path)])
    thread.join()
    assert (tmp_path / "closed").read_text() == "once"


@pytest.mark.parametrize("ignored", [False, True], ids=["in front", "background job of a script"])
def test_a_stage_closes_its_files_when_its_parent_is_killed(tmp_path, ignored):
    start = [sys.executable, "-c", RUNNER, PATIENT, str(tmp_path)]
    if ignored:
        start = ["sh", "-c", 'trap "" INT; exec "$@"', "sh", *start]
    with subprocess.Popen(start, stdout=subprocess.DEVNULL) as parent:
        wait_for((tmp_path / "started").exists)
        parent.kill()
    wait_for((tmp_path / "closed").exists)


def test_a_background_verb_is_stopped_at_the_end(scripts, tmp_path):
    with stages.Background([PATIENT, str(tmp_path)], tmp_path / "log") as background:
        background.wait_until((tmp_path / "started").exists, "a file", 60.0)
        assert background.process.poll() is None
    assert background.process.poll() == 130
    assert (tmp_path / "closed").exists()


def test_a_background_verb_that_dies_is_named_with_its_last_words(scripts, tmp_path):
    with (
        stages.Background(["raise SystemExit('no pseudo-terminal')"], tmp_path / "log") as background,
        pytest.raises(DeviceError, match=r"(?s)exit code 1.*no pseudo-terminal"),
    ):
        background.wait_until(lambda: False, "a rig file", 20.0)


def test_a_command_line_is_this_installation():
    shown = subprocess.run(stages.command_line(["--help"]), capture_output=True, text=True, check=True).stdout
    assert "soft tactile skins" in shown or "Usage" in shown


def test_a_background_verb_ends_as_a_stage_that_shows_what_it_says_from_then_on(scripts, tmp_path, capfd):
    program = """
import os, sys, time
from pathlib import Path
print("ear" + "ly", flush=True)
print("wait" + "ing", flush=True)
while not (Path(sys.argv[1]) / "go").exists():
    time.sleep(0.01)
print("niceness", os.nice(0))
sys.exit(3)
"""
    line, log = stages.Line(1, "kept"), tmp_path / "log"
    with stages.Background([program, str(tmp_path)], log, yielding=True) as background:
        wait_for(lambda: "waiting" in log.read_text())
        threading.Timer(0.3, (tmp_path / "go").touch).start()
        line.join("wait for it", background, tolerated=3)
    shown = capfd.readouterr().out
    assert "[1/1] wait for it" in shown and "exit code 3: going on" in shown
    assert "early" not in shown and "waiting" in shown
    assert int(shown.rsplit("niceness ", 1)[1].split()[0]) >= 10


def test_a_background_verb_that_failed_before_it_is_joined_is_shown_whole(scripts, tmp_path, capfd):
    line = stages.Line(1, "kept")
    with stages.Background(["print('why'); print('what next'); raise SystemExit(4)"], tmp_path / "log") as background:
        background.process.wait()
        with pytest.raises(stages.StageError, match="exit code 4"):
            line.join("wait for it", background)
    shown = capfd.readouterr().out
    assert "why" in shown and "what next" in shown
