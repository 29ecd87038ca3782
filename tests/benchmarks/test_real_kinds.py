"""How a verdict on a stand-in for real recordings is scored."""

import importlib.util
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOM = Path(__file__).parents[2] / "benchmarks" / "real_kinds"
PLAY = "friction and play"


@pytest.fixture(scope="module")
def outcome():
    """Return the benchmark's scorer."""
    sys.path.insert(0, str(ROOM))
    spec = importlib.util.spec_from_file_location("real_kinds_run", ROOM / "run.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.outcome


def row(mechanism, family, status, level, alternatives=()):
    """Return a verdict with one effect on a piston with dry friction."""
    effect = {
        "mechanism": mechanism,
        "family": family,
        "status": status,
        "level": level,
        "alternatives": list(alternatives),
    }
    return {"kind": "piston", "share": 0.15, "remainder": "real bend", "verdict": {"effects": [effect]}}


@pytest.mark.parametrize(
    ("given", "right"),
    [
        (row("hysteresis", PLAY, "ambiguous", "family", ["dry_friction"]), {"family", "mechanism", "suspected"}),
        (row("hysteresis", PLAY, "ambiguous", None, ["dry_friction", "latency"]), {"suspected"}),
        (row("latency", "delay and filtering", "ambiguous", "family", ["servo_lag"]), {"wrong"}),
        (row("dry_friction", PLAY, "named", "form"), {"family", "mechanism", "suspected"}),
        (row("hysteresis", PLAY, "named", "form"), {"family", "wrong"}),
        (row("hysteresis", PLAY, "named", "family"), {"family"}),
    ],
)
def test_a_set_of_one_family_tells_the_family_and_answers_for_it(outcome, given, right):
    assert {name for name, true in outcome(given).items() if true} == right


RUN = """
import os, sys, time
sys.path.insert(0, {room!r})
from workers import pool

def one(number):
    print(os.getpid(), flush=True)
    time.sleep(120)

if __name__ == "__main__":
    with pool(1) as running:
        running.map(one, [0])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_run_that_is_killed_leaves_no_worker(tmp_path):
    script = tmp_path / "run.py"
    script.write_text(RUN.format(room=str(ROOM)))
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True) as run:
        worker = int(run.stdout.readline())
        assert there(worker)
        run.send_signal(signal.SIGKILL)
        until = time.monotonic() + 30
        while there(worker) and time.monotonic() < until:
            time.sleep(0.05)
        assert not there(worker)


def there(process):
    """Return whether a process runs; one that ended and was not asked for does not."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{process}/stat")
    return not (state.exists() and state.read_text().rsplit(")", 1)[1].split()[0] == "Z")
