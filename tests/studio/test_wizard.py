"""The wizard asked as a page asks: by real requests, with real files."""

import json
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import pytest
import yaml

from tacdata.recording import read_session
from tacdata.studio.wizard.server import wizard_server
from tacdata.studio.wizard.wizard import Wizard

STROKE = np.concatenate([np.zeros(10), np.linspace(0, 1, 20), np.ones(10), np.linspace(1, 0, 20), np.zeros(10)])
T = 0.05 * np.arange(3 * len(STROKE))
DEPTH = np.tile(STROKE, 3)
C0, C1 = 10 + DEPTH + 0.001 * np.sin(7 * T), 10 + 0.6 * DEPTH + 0.001 * np.cos(9 * T)


def written(path, header, *columns):
    rows = [",".join(str(value) for value in row) for row in zip(*columns, strict=True)]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([header, *rows]), encoding="utf-8")
    return path


@pytest.fixture
def source(tmp_path):
    """Three presses by a machine's height, two channels, a temperature of an unusual name."""
    return written(tmp_path / "in" / "run.csv", "t_s,arm (mm),a,b,oven", T, 31.2 - DEPTH, C0, C1, 21 + 0.01 * T)


@pytest.fixture
def wizard(source, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with wizard_server(Wizard.of(source, tmp_path / "mapping.yaml", tmp_path / "session"), 0) as address:
        yield address


def asked(address, path="", body=None, **headers):
    """Return the answer to a request, as JSON or text."""
    headers = {"Content-Type": "application/json", **{name.replace("_", "-"): value for name, value in headers.items()}}
    data = None if body is None else json.dumps(body).encode()
    with urlopen(Request(address + path, data, headers)) as answer:
        text = answer.read().decode()
    return json.loads(text) if path else text


def refused(address, path, body=None, **headers):
    """Return the status and the words of a refusal."""
    with pytest.raises(HTTPError) as caught:
        asked(address, path, body, **headers)
    return caught.value.code, caught.value.read().decode()


def assigned(choices, column, **changes):
    """Return choices with another assignment of a column."""
    assignments = [each | changes if each["column"] == column else each for each in choices["assignments"]]
    return choices | {"assignments": assignments}


def test_the_page_shows_each_column_with_its_role_its_grounds_and_its_course(wizard):
    contents = asked(wizard, "contents")
    (file,) = contents["files"]
    roles = {each["column"]: each["role"] for each in contents["choices"]["assignments"]}
    assert roles == {"t_s": "time", "arm (mm)": "z", "a": "channels", "b": "channels", "oven": "channels"}
    grounds = {column["name"]: "; ".join(column["evidence"]) for column in file["columns"]}
    assert "its name states time; its unit is s" in grounds["t_s"] and "always rises" in grounds["t_s"]
    assert "follows the position (r = -1.00)" in grounds["a"]
    assert "follows" not in grounds["oven"]
    assert file["head"][0][:2] == ["0", "31.2"] and len(file["head"]) == 6
    assert len(file["time"]) == len(file["columns"][1]["values"]) <= 240
    assert min(file["columns"][1]["values"]) == pytest.approx(30.2, abs=0.01)


def test_choices_left_as_they_were_give_the_proposal_itself(wizard):
    choices = asked(wizard, "contents")["choices"]
    before = asked(wizard, "try", choices)
    assert "3 recordings of 70 rows at 20 Hz, 3 channels" in before["sentence"]
    assert yaml.safe_load(before["text"])["position"] == {"file": "run", "z": {"column": "arm (mm)"}}
    assert yaml.safe_load(before["text"])["trials"] == {"press_above": 0.1} and before["cut_above"] is None
    assert asked(wizard, "try", choices | {"trials": {}})["cut_above"] == 0.1


def test_a_changed_role_a_rule_and_a_height_change_the_presses_at_once(wizard):
    choices = assigned(asked(wizard, "contents")["choices"], "oven", role="temperature", unit="degC")
    got = asked(wizard, "try", choices | {"trials": {"press_above": 0.1}, "contact": 30.9})
    assert "3 recordings" in got["sentence"] and "2 channels, all answer, pressed 0.7 mm deep" in got["sentence"]
    assert got["good"] and got["found"] == len(got["presses"]) == 3
    document = yaml.safe_load(got["text"])
    assert document["measured"] == {"temperature": {"file": "run", "columns": ["oven"], "unit": "degC"}}
    assert document["contact"] == {"z": 30.9, "known_from": "read off by a person"}
    assert max(got["presses"][1]["depth"]["series"][0]["values"]) == pytest.approx(0.7)
    channels = {each["name"]: max(each["values"]) for each in got["presses"][0]["channels"]["series"]}
    assert channels == {"a": pytest.approx(1, abs=0.01), "b": pytest.approx(0.6, abs=0.01)}
    assert got["path"]["title"] == "3 presses found in run.csv"


def test_rows_that_were_set_aside_are_points_of_their_own(tmp_path):
    depth = DEPTH.copy()
    depth[35::70] = 0.0  # one read of zero in each hold
    path = written(tmp_path / "run.csv", "t (s),depth (mm),a,b", T, depth, C0, C1)
    with wizard_server(Wizard.of(path, tmp_path / "m.yaml", tmp_path / "s"), 0) as address:
        got = asked(address, "try", asked(address, "contents")["choices"])
    series = {each["name"]: each["values"] for each in got["path"]["series"]}
    aside = [k for k, value in enumerate(series["set aside"]) if value is not None]
    assert [got["path"]["x"]["values"][k] for k in aside] == pytest.approx([1.75, 5.25, 8.75])
    assert any("dropouts" in words for words in got["set_aside"])


def test_rows_set_aside_are_kept_where_a_person_says_so(tmp_path):
    depth = DEPTH.copy()
    depth[35::70] = 0.0
    path = written(tmp_path / "run.csv", "t (s),depth (mm),a,b", T, depth, C0, C1)
    with wizard_server(Wizard.of(path, tmp_path / "m.yaml", tmp_path / "s"), 0) as address:
        choices = asked(address, "contents")["choices"]
        kept = asked(address, "try", choices | {"trusted": True, "trials": {}})
    assert not any("dropouts" in words for words in kept["set_aside"])
    assert yaml.safe_load(kept["text"])["position"]["trusted"] is True


def test_a_time_that_goes_back_is_drawn_by_rows(tmp_path):
    time = np.concatenate([T[:70], T[:70], T[:70]])
    path = written(tmp_path / "run.csv", "t (s),depth (mm),a,b", time, DEPTH, C0, C1)
    with wizard_server(Wizard.of(path, tmp_path / "m.yaml", tmp_path / "s"), 0) as address:
        got = asked(address, "try", asked(address, "contents")["choices"])
    assert got["path"]["x"] == {"label": "row", "values": list(range(210))}
    assert not got["good"] and any("time goes back" in words for words in got["faults"])


def test_a_clock_without_a_unit_has_its_units_as_answers(tmp_path):
    path = written(tmp_path / "run.csv", "time,depth (mm),a,b", 740311 + T / 86400, DEPTH, C0, C1)
    with wizard_server(Wizard.of(path, tmp_path / "m.yaml", tmp_path / "s"), 0) as address:
        contents = asked(address, "contents")
        assert asked(address, "try", contents["choices"])["found"] == 0
        question = next(each for each in contents["questions"] if "no unit is given" in each["text"])
        answer = next(each for each in question["answers"] if each["label"] == "datenum")
        assert answer["change"] == {"columns": [["run", "time"]], "unit": "datenum"}
        choices = assigned(contents["choices"], "time", unit="datenum")
        assert "at 20 Hz" in asked(address, "try", choices)["sentence"]


@pytest.mark.parametrize(
    ("column", "change", "words"),
    (
        ("a", {"role": "z"}, "two columns for one axis (arm (mm), a)"),
        ("arm (mm)", {"unit": "parsec"}, "parsec"),
        ("t_s", {"role": "time", "unit": "fortnight"}, "time"),
    ),
)
def test_an_impossible_choice_ends_in_words(wizard, column, change, words):
    choices = assigned(asked(wizard, "contents")["choices"], column, **change)
    try:
        answer = json.dumps(asked(wizard, "try", choices))
    except HTTPError as error:
        assert error.code == 422
        answer = error.read().decode()
    assert words in answer and "Traceback" not in answer


def test_no_channel_and_a_body_that_does_not_fit_are_refused(wizard):
    choices = asked(wizard, "contents")["choices"]
    for name in ("a", "b", "oven"):
        choices = assigned(choices, name, role="")
    assert "no column is a channel" in refused(wizard, "try", choices)[1]
    assert refused(wizard, "try", {"contact": "high"})[0] == 422


def test_the_mapping_is_written_once_and_replaced_only_by_consent(wizard, tmp_path, source):
    asked_for = {"choices": asked(wizard, "contents")["choices"], "file": "mapping.yaml"}
    first = asked(wizard, "write", asked_for)
    assert first["command"] == f"tacdata import {source} --mapping mapping.yaml --out {tmp_path / 'session'}"
    text = (tmp_path / "mapping.yaml").read_text()
    changed = {**asked_for, "choices": asked_for["choices"] | {"name": "another"}}
    assert asked(wizard, "write", changed) == {"question": "mapping.yaml exists. Replace it?"}
    assert (tmp_path / "mapping.yaml").read_text() == text
    assert "command" in asked(wizard, "write", {**changed, "replace": True})
    assert yaml.safe_load((tmp_path / "mapping.yaml").read_text())["name"] == "another"
    for name in ("run.csv", "nowhere/mapping.yaml", "."):
        assert "a .yaml file" in refused(wizard, "write", {**asked_for, "file": name})[1]


def test_the_session_is_imported_and_checked_and_no_session_is_replaced(wizard, tmp_path):
    choices = asked(wizard, "contents")["choices"] | {"trials": {"press_above": 0.1}}
    asked(wizard, "write", {"choices": choices, "file": "mapping.yaml"})
    made = asked(wizard, "import", {"file": "mapping.yaml", "session": "session"})
    assert made["recordings"] == 3 == len(read_session(tmp_path / "session").episodes)
    assert made["commands"][0].startswith("tacdata import ") and made["check"]
    assert "session exists" in refused(wizard, "import", {"file": "mapping.yaml", "session": "session"})[1]


def test_a_verdict_is_computed_and_shown_where_one_is_wanted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    noise = np.random.default_rng(0).normal(0, 0.002, (2, len(T)))
    source = written(tmp_path / "in" / "run.csv", "t_s,depth (mm),a,b", T, DEPTH, C0 + noise[0], C1 + noise[1])
    with wizard_server(Wizard.of(source, tmp_path / "mapping.yaml", tmp_path / "session"), 0) as address:
        asked(address, "write", {"choices": asked(address, "contents")["choices"], "file": "mapping.yaml"})
        asked(address, "import", {"file": "mapping.yaml", "session": "session"})
        found = asked(address, "judge", {"session": "session"})
        assert found["text"] == (tmp_path / "session-verdict" / "verdict.txt").read_text()
        with urlopen(address + found["page"]) as answer:
            assert answer.read() == (tmp_path / "session-verdict" / "verdict.html").read_bytes()
        assert "no verdict 3" in refused(address, "verdict/3")[1]
        assert "session-verdict exists" in refused(address, "judge", {"session": "session"})[1]


def test_a_mapping_of_a_person_is_gone_on_with(source, tmp_path):
    document = {
        "version": "1.6",
        "name": "mine",
        "files": {"run": {"path": "run.csv", "time": {"column": "t_s"}, "missing": [-999]}},
        "sensor": {"name": "two", "columns": 2, "pitch_x": 4.0},
        "taxels": {"file": "run", "columns": ["a", "b"], "unit": "pF"},
        "position": {"file": "run", "depth": {"expression": "31.2 - `arm (mm)`", "unit": "mm"}},
    }
    mapping = tmp_path / "mine.yaml"
    mapping.write_text(yaml.safe_dump(document))
    wizard = Wizard.of(source, mapping, tmp_path / "s", mapping)
    with wizard_server(wizard, 0) as address:
        contents = asked(address, "contents")
        got = asked(address, "try", contents["choices"])
    assert contents["questions"] == []
    assert {**yaml.safe_load(got["text"]), "version": "1.6"} == document
    assert "pressed 1 mm deep" in got["sentence"]


def test_only_the_page_itself_is_answered(wizard):
    assert "Import" in asked(wizard)
    with urlopen(wizard) as answer:
        policy = answer.headers["Content-Security-Policy"]
    assert "connect-src 'self'" in policy and "frame-ancestors 'none'" in policy
    host, token = wizard.rstrip("/").rsplit("/", 1)
    assert host.startswith("http://127.0.0.1:") and len(token) > 20
    assert refused(f"{host}/", "contents")[0] == 404
    assert refused(f"{host}/{token[:-1]}x/", "write", {"file": "a.yaml"})[0] == 404
    assert refused(wizard, "contents", Host="rebound.example")[0] == 404
    assert refused(wizard, "try", {}, Content_Type="text/plain")[0] == 422, "a form of another page sends no JSON"
