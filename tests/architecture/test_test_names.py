"""No two test files share a name: pytest imports each by its bare name, and refuses the second."""

from collections import Counter
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]


def test_every_test_file_has_a_name_of_its_own():
    names = Counter(path.name for path in TESTS.rglob("test_*.py"))
    shared = sorted(name for name, count in names.items() if count > 1)
    assert len(names) > 100
    assert not shared, f"{shared}: rename all but one of each, pytest collects a whole room group at once"
