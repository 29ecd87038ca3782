"""Flags lie beside the data and follow a recording by its hash."""

from types import SimpleNamespace

import pytest

from tacdata.dataset.flags import clear_flag, flagged_episodes, path_of, read_flags, set_flag
from tacdata.errors import FormatError, UsageError

HASH = "a" * 64


def test_a_flag_is_kept_with_its_reason_and_taken_back(tmp_path):
    assert read_flags(tmp_path) == {}
    set_flag(tmp_path, HASH, "episode-000003.mcap", "  slipped\n tool ")
    set_flag(tmp_path, "b" * 64, "episode-000004.mcap", "no contact")
    assert read_flags(tmp_path)[HASH].reason == "slipped tool"
    clear_flag(tmp_path, HASH)
    assert set(read_flags(tmp_path)) == {"b" * 64}
    assert path_of(tmp_path).name == "flags.json"


def test_a_flag_wants_a_reason(tmp_path):
    for reason in ("", " \n", "x" * 501):
        with pytest.raises(UsageError):
            set_flag(tmp_path, HASH, "episode-000003.mcap", reason)
    assert not path_of(tmp_path).exists()


def test_a_datasets_flagged_episodes_are_found_by_the_recordings_hash(tmp_path):
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta/info.json").write_text("{}")
    set_flag(tmp_path, HASH, "episode-000003.mcap", "slipped")
    assert path_of(tmp_path).parent.name == "meta"
    episodes = [
        SimpleNamespace(index=0, record=None),
        SimpleNamespace(index=1, record=SimpleNamespace(recording="c" * 64)),
        SimpleNamespace(index=2, record=SimpleNamespace(recording=HASH)),
    ]
    assert flagged_episodes(SimpleNamespace(root=tmp_path, episodes=episodes)) == {2: "slipped"}


def test_a_damaged_file_is_named(tmp_path):
    (tmp_path / "flags.json").write_text('{"version": "1.0", "flags": [{"recording": 3}]}')
    with pytest.raises(FormatError, match=r"flags\.json"):
        read_flags(tmp_path)
