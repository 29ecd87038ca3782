"""The verb in a process of its own."""

import signal
import subprocess
import sys
import time

from tacdata.rig import read_rig


def test_runs_until_terminated_and_leaves_only_the_truth(tmp_path):
    options = ["--speed", "20", "--no-camera"]
    command = [sys.executable, "-m", "tacdata.cli", "virtual-rig", str(tmp_path), *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        path, end = tmp_path / "rig.yaml", time.monotonic() + 60
        while not path.exists() and time.monotonic() < end and process.poll() is None:
            time.sleep(0.05)
        rig = read_rig(path)
        second = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    finally:
        process.send_signal(signal.SIGTERM)
        said, complaint = process.communicate(timeout=60)
    assert process.returncode == 0, complaint
    assert complaint == ""
    assert str(path) in said
    assert rig.board["port"] in said
    assert "24 channels, 30 Hz" in said
    assert (second.returncode, "a virtual rig is running" in second.stderr) == (2, True)
    assert "Traceback" not in second.stderr
    assert not path.exists()
    assert (tmp_path / "truth.yaml").exists()
