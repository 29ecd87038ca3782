"""The example on the virtual rig: what the first session cannot tell, the planned presses do."""

import importlib.util
import json
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "closed_loop" / "closed_loop.py"


@pytest.mark.long(
    "tacdata/commands", "tacdata/virtual_rig", "examples/closed_loop", reason="two rounds of recording and judging"
)
@pytest.mark.timeout(1200)
def test_play_hidden_in_the_virtual_rig_is_found_by_the_presses_that_the_first_verdict_asks_for(tmp_path):
    spec = importlib.util.spec_from_file_location("closed_loop", EXAMPLE)
    assert spec and spec.loader
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    example.loop(tmp_path / "loop", speed=4.0, rounds=2)
    first, second = (json.loads((tmp_path / "loop" / f"verdict-{k}" / "verdict.json").read_text()) for k in (1, 2))
    assert first["status"] != "named", "presses of one speed cannot name it"
    found = {e["mechanism"]: e for e in second["effects"]}
    assert "backlash" in found
    assert found["backlash"]["parameters"]["b"]["value"] == pytest.approx(example.PLAY, rel=0.2)
    assert (tmp_path / "loop" / "revision-2" / "card.html").is_file()
