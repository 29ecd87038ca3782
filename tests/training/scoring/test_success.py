"""Success rates from files and counts."""

import pytest

from tacdata.errors import FormatError, UsageError
from tacdata.training.scoring import published
from tacdata.training.scoring.success import counted, markdown, published_rates, rates, read_attempts


def written(tmp_path, text):
    path = tmp_path / "trials.csv"
    path.write_text(text)
    return path


def paper_trials():
    """Forty trials of dense-depth feedback: eight positions, five times, 17 of 20 at the edge and 18 inside."""
    lines = ["condition,position,success,adjustments"]
    failures = {("1", 0), ("2", 0), ("7", 0), ("3", 0), ("4", 0)}
    for position in "12345678":
        lines += [f"dense,{position},{int((position, k) not in failures)},{k % 3}" for k in range(5)]
    return "\n".join(lines)


def test_conditions_groups_and_positions(tmp_path):
    found = rates(read_attempts(written(tmp_path, paper_trials())), {"edge": set("1278")})
    by_group = {r.group: r for r in found}
    assert (by_group["all"].successes, by_group["all"].trials) == (35, 40)
    assert (by_group["edge"].successes, by_group["edge"].trials) == (17, 20)
    assert (by_group["position 1"].successes, by_group["position 1"].trials) == (4, 5)
    assert by_group["all"].interval == pytest.approx((0.7389, 0.9454), abs=6e-5)
    # The five failures made no adjustment: the 35 others made 16 times 1 and 8 times 2... of 40: 16 x 0, 16 x 1, 8 x 2.
    assert by_group["all"].adjustments[0] == pytest.approx((16 * 1 + 8 * 2) / 35)
    assert "| dense | edge | 17/20 | 85.0 | 64.0 to 94.8 |" in markdown(found)


def test_the_papers_counts_give_the_papers_rates():
    """37.5, 67.5, 87.5 % over all positions and 20, 45, 85 % at the edge, as printed."""
    printed = [37.5, 20.0, 67.5, 45.0, 87.5, 85.0]
    assert [round(100 * r.successes / r.trials, 1) for r in published_rates()] == printed
    assert set(published.SUCCESS) == {"contact only", "raw taxels", "dense depth"}


def test_intervals_are_wilsons():
    """Worked out with a pocket calculator from the quadratic, z^2 = 3.841459, to four digits."""
    wanted = [(0.2422, 0.5297), (0.0807, 0.416), (0.5202, 0.7992), (0.2582, 0.6579), (0.7389, 0.9454), (0.6396, 0.9476)]
    for rate, interval in zip(published_rates(), wanted, strict=True):
        assert rate.interval == pytest.approx(interval, abs=6e-5)
    assert counted("none=0/10").interval == pytest.approx((0.0, 3.841459 / (10 + 3.841459)), abs=1e-6)
    assert counted("all=10/10").interval[1] == 1.0


def test_counts_typed_in():
    assert counted("dense=35/40").interval == pytest.approx((0.7389, 0.9454), abs=6e-5)
    for text in ("dense=35", "dense=a/b", "dense=41/40", "dense=0/0"):
        with pytest.raises(UsageError):
            counted(text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("condition,position\na,1\n", "no column success"),
        ("condition,success\n", "holds no trial"),
        ("condition,success\na,1\na,maybe\n", "line 3"),
        ("condition,success,adjustments\na,1,-2\n", "adjustments '-2'"),
        ("condition,success\n,1\n", "condition ''"),
    ],
)
def test_damaged_files_are_refused(tmp_path, text, words):
    with pytest.raises(FormatError, match=words):
        read_attempts(written(tmp_path, text))


def test_a_group_without_trials_is_refused(tmp_path):
    attempts = read_attempts(written(tmp_path, paper_trials()))
    with pytest.raises(UsageError, match="positions 9 are in no trial"):
        rates(attempts, {"edge": {"1", "9"}})
