"""A first look: the shipped recording is checked and drawn, and stays small."""

import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

import tacdata as td
from tacdata import cli
from tacdata.errors import Exit
from tacdata.example.shipped import DEEPEST, SESSION
from tacdata.recording.session import read_session

APP = cli.application()


def example(*arguments):
    return CliRunner().invoke(APP, ["example", *map(str, arguments)])


def test_it_checks_and_draws_the_shipped_recording(tmp_path):
    shown = example(tmp_path / "first", "--json")
    assert shown.exit_code == Exit.DONE, shown.output
    found = json.loads(shown.stdout)
    assert found["check"]["usable"] and not found["check"]["findings"]
    assert found["press"]["number"] == DEEPEST
    assert any("label" in line.lower() for line in found["press"]["found"])
    for name in ("check.png", "press.png"):
        assert (tmp_path / "first" / name).read_bytes().startswith(b"\x89PNG")


def test_check_and_card_count_the_same_frames_off_the_path(tmp_path):
    shown = example(tmp_path / "first").stdout
    td.pack(tmp_path / "first", tmp_path / "data")
    card = json.loads(CliRunner().invoke(APP, ["card", str(tmp_path / "data"), "--json"]).stdout)
    lost, outside = map(int, re.search(r"(\d+) lost, (\d+) outside the commanded path", shown).groups())
    assert (card["frames_after_a_loss"], card["frames_outside_the_path"]) == (lost, outside)
    invalid = np.count_nonzero(~np.asarray(td.open(tmp_path / "data")["tacdata.valid"]))
    assert invalid == lost + outside > 0


def test_it_says_what_to_do_next_and_overwrites_nothing(tmp_path):
    assert "next:" in example(tmp_path / "first").stdout
    before = sorted(path.name for path in (tmp_path / "first").iterdir())
    again = example(tmp_path / "first")
    assert again.exception.exit_code == Exit.USAGE
    assert sorted(path.name for path in (tmp_path / "first").iterdir()) == before


def test_the_shipped_recording_is_small_and_names_no_place_of_its_maker():
    files = [path for path in SESSION.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 2e6
    assert len(read_session(SESSION).episodes) == 2
    assert len(list((SESSION / "labels").glob("episode-*.parquet"))) == 2
    assert not [path for path in files if b"/root/" in path.read_bytes() or b"/home/" in path.read_bytes()]


@pytest.mark.long(
    "tacdata/skin", "tacdata/indenters", "label_farm", reason="models change often; their labels are renewed at times"
)
def test_the_shipped_labels_are_of_todays_model(tmp_path):
    """`sh .dev/example` renews them."""
    example(tmp_path / "first")
    labelled = CliRunner().invoke(APP, ["label", str(tmp_path / "first")])
    assert labelled.exit_code == Exit.DONE, labelled.exception
    assert "labels written: 0 (0 without contact), already there: 2" in labelled.stdout
