"""Workers and the service killed at random: nothing lost, nothing doubled, nothing different."""

import chaos
import pytest

SESSIONS, PRESSES, KILLS = 2, 60, 14


@pytest.mark.long("label_farm", reason="workers and the service are killed at random, many times over")
@pytest.mark.timeout(600)
def test_random_kills_leave_what_an_undisturbed_run_leaves(tmp_path):
    """`benchmarks/label_farm_chaos.py` does it with 2,000 presses and 200 kills."""
    chaotic, peaceful = tmp_path / "chaotic", tmp_path / "peaceful"
    chaotic.mkdir()
    peaceful.mkdir()
    names = chaos.record(chaotic, SESSIONS, PRESSES)
    killed, left, _ = chaos.torment(chaotic, names, SESSIONS * PRESSES, KILLS)
    assert sum(killed.values()) == KILLS and killed["worker"] and left > 0
    chaos.undisturbed(peaceful, chaotic, names)
    again = chaos.compare(chaotic, peaceful, names, PRESSES)
    assert again <= 2 * KILLS, "a kill costs what was in work, no more"
