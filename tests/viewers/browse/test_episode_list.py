"""Choosing among episodes, and the page that does it in a browser."""

import json
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import pytest

from tacdata import documents
from tacdata.errors import UsageError
from tacdata.viewers.browse.episode_list import Entry, EpisodeList, errors_of
from tacdata.viewers.browse.flagging import flag_episode, unflag_episode
from tacdata.viewers.browse.list_table import list_table
from tacdata.viewers.browse.noting import note_stretch, notes_of, unnote_stretch
from tacdata.viewers.browse.server import Pages, serving

ENTRIES = (
    Entry(0, "episode-000000.mcap", "ball", "sphere", 0, 0, 0.4, 1.0, 1.0, "complete", "test", 0.01),
    Entry(1, "episode-000001.mcap", "ball", "sphere", 1, 0, 1.2, 1.0, 0.9, "complete", "test", 0.05),
    Entry(2, "episode-000002.mcap", "pin", "cone", 1, 2, 0.9, 3.0, None, "failed"),
)


@pytest.fixture
def listed(tmp_path):
    for entry in ENTRIES:
        (tmp_path / entry.file).write_text(entry.file)
    return EpisodeList(tmp_path, "session", ENTRIES)


def numbers(chosen):
    return [entry.number for entry in chosen.entries]


@pytest.mark.parametrize(
    ("condition", "kept"),
    [
        ("depth>0.8", [1, 2]),
        ("indenter=ball", [0, 1]),
        ("label!=complete", [2]),
        ("quality>=0.9", [0, 1]),
        ("error < 0.02", [0]),
        ("flag=", [0, 1, 2]),
    ],
)
def test_conditions(listed, condition, kept):
    assert numbers(listed.where(condition)) == kept


def test_a_condition_that_no_episode_fits_says_which_values_there_are(listed):
    assert listed.where("depth>5").remarks == ("no episode fits depth>5: depth is 0.4 to 1.2 mm",)
    assert listed.where("indenter=ring").remarks == ("no episode fits indenter=ring: indenter is ball, pin",)
    assert not listed.where("depth>1").remarks


def test_the_worst_comes_first_and_the_unknown_last(listed):
    assert numbers(listed.by("error")) == [1, 0, 2]
    assert numbers(listed.by("depth")) == [0, 2, 1]
    assert numbers(listed.by("-rate")) == [2, 0, 1]


@pytest.mark.parametrize("condition", ["depht>1", "depth", "depth>deep"])
def test_conditions_that_mean_nothing(listed, condition):
    with pytest.raises(UsageError):
        listed.where(condition)
    with pytest.raises(UsageError, match="depht"):
        listed.by("depht")


def test_the_table_says_units_and_leaves_empty_columns_out(listed):
    table = list_table(listed.where("label=complete"), 1, True)
    assert "depth [mm]" in table and "rate [mm/s]" in table and "flag" not in table.splitlines()[0]
    assert "1 more" in table and "0.0100" in table


def test_a_flag_follows_the_recordings_bytes(listed):
    flag_episode(listed, 1, "slipped")
    written = documents.read(listed.root / "flags.json", "flags")["flags"]
    assert [(f["file"], f["reason"]) for f in written] == [("episode-000001.mcap", "slipped")]
    unflag_episode(listed, 1)
    assert documents.read(listed.root / "flags.json", "flags")["flags"] == []
    with pytest.raises(UsageError, match="episode 9"):
        flag_episode(listed, 9, "x")


def test_errors_are_of_the_frames_that_both_hold():
    label, predicted = np.zeros((3, 2, 2), np.float32), np.full((2, 2, 2), 0.3, np.float32)
    assert errors_of(label, np.array([1, 2, 3]), predicted, np.array([2, 9])).error == pytest.approx(0.3)
    assert errors_of(label, np.array([1, 2, 3]), predicted, np.array([8, 9])) is None
    assert errors_of(label, np.array([1, 2, 3]), predicted[:, :1], np.array([2, 9])) is None


def test_place_and_region_of_the_contact_are_means_of_the_frames_that_have_them():
    label, predicted = np.zeros((3, 8, 6), np.float32), np.zeros((3, 8, 6), np.float32)
    label[1:, 2:4, 2:4] = 1.0
    predicted[1, 2:4, 2:4] = 0.8  # the right place
    predicted[2, 3:5, 2:4] = 1.0  # a pixel aside: a third of the union is shared
    found = errors_of(label, np.arange(3), predicted, np.arange(3))
    assert found.centroid == pytest.approx(0.5) and found.iou == pytest.approx((1 + 1 / 3) / 2)
    assert errors_of(label[:1], np.arange(1), predicted[:1], np.arange(1)).iou is None, "nothing was touched"


def test_notes_on_stretches_are_kept_beside_the_data(listed):
    note_stretch(listed, 1, 2.0, 2.5, "the tool  slips")
    note_stretch(listed, 1, 0.5, 1, "a knock")
    first, second = notes_of(listed, 1)
    assert (first.text, second.begin, second.text) == ("a knock", 2.0, "the tool slips") and "@" in first.by
    assert documents.read(listed.root / "notes.json", "notes")["notes"][0]["file"] == "episode-000001.mcap"
    for begin, end, text, words in ((2, 1, "x", "2 to 1 s"), (-1, 1, "x", "-1 to 1"), (0, 1, " ", "without a text")):
        with pytest.raises(UsageError, match=words):
            note_stretch(listed, 1, begin, end, text)
    assert unnote_stretch(listed, 1, 0) == "a knock" and notes_of(listed, 1) == [second] and not notes_of(listed, 0)
    with pytest.raises(UsageError, match="note 5 of episode 1"):
        unnote_stretch(listed, 1, 5)


@pytest.fixture
def served(listed, tmp_path):
    """The page without Rerun's viewer beside it."""
    pages = Pages(listed, None, None, tmp_path, "http://127.0.0.1:9")
    with serving(pages, 0):
        yield pages


def get(address, body=None, **headers):
    data = None if body is None else json.dumps(body).encode()
    with urlopen(Request(address, data=data, headers={"Content-Type": "application/json", **headers})) as answer:
        return answer.read()


def test_the_page_lists_and_flags(served):
    assert b"<table>" in get(served.address + "/")
    rows = json.loads(get(served.address + "/list"))["episodes"]
    assert [row["number"] for row in rows] == [0, 1, 2] and rows[1]["error"] == 0.05
    assert "slipped" in json.loads(get(served.address + "/flag", {"number": 1, "reason": "slipped"}))["said"]
    assert [row["flag"] for row in json.loads(get(served.address + "/list"))["episodes"]] == ["", "slipped", ""]
    assert documents.read(served.listed.root / "flags.json", "flags")["flags"][0]["reason"] == "slipped"
    assert "taken back" in json.loads(get(served.address + "/flag", {"number": 1, "reason": " "}))["said"]


def test_whoever_does_not_know_the_address_gets_nothing(served):
    base = served.address.rsplit("/", 1)[0]
    for address, headers in (
        (base + "/", {}),
        (base + "/guess/list", {}),
        (served.address + "/list", {"Host": "evil.org"}),
    ):
        with pytest.raises(HTTPError) as caught:
            get(address, **headers)
        assert caught.value.code == 404
        caught.value.close()
    with pytest.raises(HTTPError) as caught:
        get(base + "/guess/flag", {"number": 1, "reason": "x"})
    caught.value.close()
    assert not Path(served.listed.root / "flags.json").exists()


def test_what_cannot_be_shown_is_said(served):
    for path in ("/episode/0.rrd", "/episode/77.rrd"):
        with pytest.raises(HTTPError) as caught:
            get(served.address + path)
        assert caught.value.code == 422
        assert "next" in json.loads(caught.value.read())["error"]
        caught.value.close()
    for wish, words in (({"number": 1}, "reason: "), ({"number": "no", "reason": "x"}, "number: ")):
        with pytest.raises(HTTPError) as caught:
            get(served.address + "/flag", wish)
        assert caught.value.code == 422 and json.loads(caught.value.read())["error"].startswith(words)
        caught.value.close()


def test_answers_may_be_read_by_the_viewers_page_and_are_not_kept(served):
    with urlopen(served.address + "/list") as answer:
        assert answer.headers["Access-Control-Allow-Origin"] == served.viewer
        assert answer.headers["Cache-Control"] == "no-store"
