"""A lab's folder as a list: every kind, damage in words, a recording that runs, and nothing from outside the folder."""

import json
import os
import subprocess
import sys
import time
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import pytest
from running.chromium import needs_chromium
from running.in_process import tacdata

from tacdata import documents, schemas
from tacdata.errors import UsageError
from tacdata.example import copy_session
from tacdata.recording import read_episode
from tacdata.recording.files.file_names import partial
from tacdata.recording.live.machine_state import own_state_directory
from tacdata.recording.live.recorder_process import FOLDER
from tacdata.studio import inventory as inventories
from tacdata.studio.farm import running_at
from tacdata.studio.inventory import Inventory
from tacdata.studio.server import shown_file, studio_server

PRESSES = 6


def verdict(folder):
    document = {
        "version": schemas.version("verdict"),
        "status": "unknown",
        "why": "nothing in the catalogue explains it",
        "effects": [],
        "gate": {"gap": True, "p": 0.001, "p_generic": 0.001, "noise": [1.0], "memory": 0.0},
        "left": {"share": 0.01, "t": 0.3, "before": 8.0, "after": 1.1, "floor": 1.0},
        "located": [],
        "unjudgeable": {},
        "limits": {},
        "untested": [],
        "data": {},
        "remarks": [],
        "next": ["press more: `tacdata plan --out more.yaml`"],
        "provenance": {"made_by": "t", "code_version": "0", "made_at": "x", "parents": {}, "parameters": {}},
    }
    documents.write(folder / "verdict.json", document, "verdict")
    (folder / "verdict.html").write_text("<title>a verdict</title>")
    return folder


@pytest.fixture
def lab(tmp_path):
    """A session that was labelled, a running one, a broken one, a dataset, a verdict, a farm, and a page."""
    root = tmp_path / "lab"
    root.mkdir()
    copy_session(root / "monday")
    running(copy_session(root / "evening"))
    broken = copy_session(root / "broken")
    (broken / "session.json").write_text('{"version": "1.1", "plan"')
    (root / "data" / "meta").mkdir(parents=True)
    info = {"total_episodes": 2, "total_frames": 340, "fps": 30}
    (root / "data" / "meta" / "info.json").write_text(json.dumps(info))
    verdict(root / "found" / "verdict")
    (root / "farm" / "submissions").mkdir(parents=True)
    (root / "farm" / "service.lock").write_text(f"http://0.0.0.0:8765 (process {os.getpid()})\n")
    (root / "report.html").write_text("<title>a report</title>")
    (tmp_path / "secret.html").write_text("secret")
    (root / "link.html").symlink_to(tmp_path / "secret.html")
    return root


def running(folder):
    """Make a session one that goes on: a press a minute, the third now, one broken off before it."""
    document = documents.read(folder / "session.json", "session")
    document["plan"]["presses"] = document["plan"]["presses"] * (PRESSES // 2)
    (folder / "session.json").write_text(json.dumps(document))
    now = time.time()
    for number, age in ((0, 70.0), (1, 10.0)):
        os.utime(folder / f"episode-{number:06d}.mcap", (now - age,) * 2)
    partial(folder / "episode-000002.mcap").write_bytes(b"begun")
    stopped = folder / "episode-000002.interrupted-0.mcap"
    stopped.write_bytes(b"no recording")
    os.utime(stopped, (now - 5.0,) * 2)


def by_path(root):
    return {entry.path: entry for entry in Inventory(root).entries()}


def test_everything_in_the_folder_has_its_section(lab):
    found = by_path(lab)
    sections = {path: entry.section for path, entry in found.items()}
    assert sections == {
        "evening": "Recording now",
        "monday": "Sessions",
        "broken": "Sessions",
        "data": "Datasets",
        "found/verdict": "Verdicts",
        "farm": "Label farm",
        "report.html": "Pages",
        "link.html": "Pages",
    }
    assert next(iter(found)) == "evening", "what runs comes first"
    assert found["data"].sentence.startswith("2 episodes, 340 frames")
    assert found["found/verdict"].commands[0] == "tacdata plan --out more.yaml"
    assert found["found/verdict"].pages == ("found/verdict/verdict.html",)
    assert found["farm"].address == "http://127.0.0.1:8765"


def test_a_session_says_what_check_found_and_what_comes_next(lab):
    entry = by_path(lab)["monday"]
    assert (entry.sentence, entry.tone) == ("usable, nothing to remark", "good")
    assert entry.facts == ("2 of 2 presses", "2 labelled")
    assert entry.commands == ("tacdata pack monday --out monday-dataset", "tacdata browse monday --web")
    (lab / "monday" / "labels" / "episode-000001.parquet").unlink()
    assert by_path(lab)["monday"].commands[0] == "tacdata label monday"
    report = documents.read(lab / "monday" / "check.json", "check")
    finding = {"severity": "unusable", "stream": "taxels", "file": "episode-000001.mcap", "text": "no answer"}
    documents.write(lab / "monday" / "check.json", {**report, "usable": False, "findings": [finding] * 2}, "check")
    assert by_path(lab)["monday"].sentence == ("NOT usable as it is; taxels: no answer (episode-000001.mcap); 1 more")
    (lab / "monday" / "check.json").unlink()
    assert by_path(lab)["monday"].commands[0] == "tacdata check monday"


def test_a_damaged_entry_is_listed_with_its_error(lab):
    (lab / "monday" / "check.json").write_text("[]")
    (lab / "data" / "meta" / "info.json").write_text("{}")
    found = by_path(lab)
    assert found["broken"].tone == "bad" and found["broken"].sentence.startswith("broken/session.json is not readable")
    assert found["monday"].tone == found["data"].tone == "bad" and found["evening"].running


def test_a_running_recording_has_presses_time_left_and_its_fault(lab):
    entry = by_path(lab)["evening"]
    assert entry.running and entry.facts[0] == f"2 of {PRESSES} presses" and entry.share == pytest.approx(1 / 3)
    # Four presses of a minute remain, ten seconds of which have passed.
    assert "episode-000002.partial.mcap is being written; 4 min left" in entry.sentence
    assert entry.faults[0].startswith("latest fault: episode-000002.interrupted-0.mcap cannot be read")
    assert entry.commands == ("tacdata view evening/episode-000002.partial.mcap --web",)


def test_a_recording_that_nobody_writes_has_to_be_recovered(lab):
    for path in (lab / "evening").glob("episode-*.mcap"):
        os.utime(path, (time.time() - 3600.0,) * 2)
    entry = by_path(lab)["evening"]
    assert not entry.running and entry.section == "Sessions"
    assert entry.commands[0] == "tacdata recover evening/episode-000002.partial.mcap"


def test_only_what_changed_is_read_anew(lab, monkeypatch):
    monkeypatch.setattr(inventories, "SEARCH", 1e9)
    listed = Inventory(lab)
    before = {entry.path: entry for entry in listed.entries()}
    (lab / "broken" / "session.json").write_bytes((lab / "monday" / "session.json").read_bytes())
    after = {entry.path: entry for entry in listed.entries()}
    assert after["monday"] is before["monday"] and after["broken"].tone == "good"


def test_a_service_that_has_ended_does_not_run(tmp_path):
    lock = tmp_path / "service.lock"
    for text in ("", "http://127.0.0.1:8765 (process 999999999)", "javascript:alert(1) (process 1)"):
        lock.write_text(text)
        assert running_at(lock) == ""


@pytest.mark.parametrize(
    "name", ["../secret.html", "link.html", "monday/session.json", "/etc/passwd", "none.html", "monday", "\0.html"]
)
def test_nothing_but_pages_under_the_folder_is_shown(lab, name):
    assert shown_file(lab.resolve(), "found/verdict/verdict.html").is_file()
    with pytest.raises(UsageError, match="no page"):
        shown_file(lab.resolve(), name)


def test_the_page_answers_whoever_knows_its_address(lab):
    with studio_server(Inventory(lab), 0) as address:
        with urlopen(address + "list") as answer:
            assert len(json.load(answer)["entries"]) == 8
        with urlopen(address + "file/report.html") as answer:
            assert b"a report" in answer.read()
            assert answer.headers["Content-Security-Policy"].startswith("default-src 'none'")
        foreign = Request(address + "list", headers={"Host": "example.org"})
        for wrong in (address.rpartition("/")[0][:-3] + "/list", foreign):
            with pytest.raises(HTTPError, match="404"):
                urlopen(wrong)
        with pytest.raises(HTTPError, match="422"):
            urlopen(address + "file/..%2Fsecret.html")


def test_measured_files_open_their_wizard(lab):
    rows = "".join(
        f"{0.05 * k:.2f},{depth},{10 + depth}\n" for k, depth in enumerate([0.0] * 20 + [1.0] * 20 + [0.0] * 20)
    )
    (lab / "bench").mkdir()
    (lab / "bench" / "run.csv").write_text("t [s],depth [mm],c0 [pF]\n" + rows)
    with studio_server(Inventory(lab.resolve()), 0) as address:
        with urlopen(address + "list") as answer:
            (entry,) = (each for each in json.load(answer)["entries"] if each["path"] == "bench")
        with urlopen(address + entry["pages"][0]["href"]) as answer:
            place = answer.url
            assert b"bench: import" in answer.read()
        with urlopen(place + "contents") as answer:
            assert json.load(answer)["session"] == str(lab.resolve() / "bench-session")
        with pytest.raises(HTTPError, match="422"):
            urlopen(address + "import/monday")


def test_the_verb_prints_the_list(lab):
    done = tacdata("studio", lab, "--list")
    assert done.returncode == 0 and "Sessions: monday: usable, nothing to remark" in done.stdout
    assert "no folder" in tacdata("studio", lab / "none").stderr


@needs_chromium
def test_the_page_refreshes_without_losing_its_place(lab, browser):
    with studio_server(Inventory(lab), 0) as address:
        context = browser.new_context(viewport={"width": 360, "height": 500})
        page, faults, asked = context.new_page(), [], []
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("console", lambda message: faults.extend([message.text] if message.type == "error" else []))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(address)
        page.wait_for_selector("article:has-text('monday')")
        assert page.inner_text("h1") == f"evening records: 2 of {PRESSES} presses."
        assert page.evaluate("document.documentElement.scrollWidth") == 360, "nothing is cut or scrolled sideways"
        page.click("article:has-text('monday') summary")
        page.evaluate("scrollTo(0, 400)")
        (lab / "broken" / "session.json").write_bytes((lab / "monday" / "session.json").read_bytes())
        page.wait_for_selector("article:has(h3:text-is('broken')):has-text('usable')")
        assert page.evaluate("scrollY") == 400 and page.is_visible("text=tacdata browse monday --web")
        page.fill("#filter", "verdict")
        assert page.locator("article:visible").count() == 1
        with context.expect_page() as opened:
            page.click("article:visible a")
        assert opened.value.title() == "a verdict"
        context.close()
        assert not faults and all(url.startswith(address) for url in asked)


@pytest.fixture
def recorder(lab):
    """A process that stands for the recorder of a session whose third press is half written."""
    whole = (lab / "monday" / "episode-000001.mcap").read_bytes()
    partial(lab / "evening" / "episode-000002.mcap").write_bytes(whole[: len(whole) // 2])
    with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(100)", "record"]) as process:
        file = own_state_directory() / FOLDER / str(process.pid)
        file.parent.mkdir(parents=True)
        file.write_text(str(lab / "evening"))
        (file.parent / "999999999").write_text(str(lab / "evening"))
        yield process
        process.kill()


@needs_chromium
def test_a_running_recording_shows_its_taxels_and_tip_and_is_stopped(lab, recorder, browser):
    episode = read_episode(lab / "monday" / "episode-000001.mcap")
    with studio_server(Inventory(lab), 0) as address:
        for wrong in ("live/monday", "live/..%2Flab%2Fevening", "live/none"):
            with pytest.raises(HTTPError, match="422"):
                urlopen(address + wrong)
        now = json.load(urlopen(address + "live/evening"))
        half = episode.taxels.counts - episode.taxels.counts[:10].mean(axis=0)
        assert now["columns"] == 6 and np.abs(half - now["change"]).max(axis=1).min() < 1e-9, "readings of one frame"
        x, y, depth = now["tip"]
        assert (x, y) == pytest.approx((-2.85, 3.75), abs=0.01) and -4.0 < depth < 0.98
        assert now["phase"] in ("approach", "press", "hold", "release")
        page = browser.new_page(viewport={"width": 360, "height": 800})
        page.goto(address)
        page.wait_for_selector(".now td")
        assert page.evaluate("document.documentElement.scrollWidth") == 360
        cells = page.locator(".now tr").evaluate_all("rows => rows.map(r => [...r.children].map(c => c.textContent))")
        shown = np.array(cells, dtype=float)[::-1].ravel()
        assert shown == pytest.approx(now["change"], abs=0.51), "row 0 is the lowest"
        assert f"tip at x {now['tip'][0]:.2f}" in page.inner_text(".now p")
        page.on("dialog", lambda dialog: dialog.accept())
        page.click("button.stop")
        page.wait_for_selector("button.stop:has-text('stopping')")
        assert recorder.wait(20) != 0
        page.wait_for_selector("button.stop", state="detached")
        with pytest.raises(HTTPError, match="422"):
            urlopen(Request(address + "stop/evening", method="POST"))
        page.close()


def test_measured_files_have_the_wizard_as_their_next_step_and_exports_of_a_session_are_none(lab):
    for number in (1, 2):
        (lab / "bench 2" / f"trial_{number}").mkdir(parents=True)
        (lab / "bench 2" / f"trial_{number}" / "skin.csv").write_text("t,cap\n")
    (lab / "monday" / "table.csv").write_text("t,cap\n")
    (lab / "loose.mat").write_bytes(b"")
    (lab / "found" / "beside.csv").write_text("t,cap\n")
    entries = {entry.path: entry for entry in Inventory(lab).entries() if entry.section == "Measured files"}
    assert set(entries) == {"bench 2", "found/beside.csv", "loose.mat"}
    assert entries["bench 2"].facts == ("2 .csv",)
    assert entries["bench 2"].commands == ("tacdata import 'bench 2' --web",)
    (lab / "bench 2-mapping.yaml").write_text("")
    again = next(entry for entry in Inventory(lab).entries() if entry.path == "bench 2")
    assert again.commands[0] == "tacdata import 'bench 2' --mapping 'bench 2-mapping.yaml' --out 'bench 2-session'"
