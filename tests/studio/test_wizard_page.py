"""The wizard in a browser: a strange file becomes a session by clicks, at three widths, and nothing else is asked."""

import numpy as np
import openpyxl
import pytest
import yaml
from running.chromium import needs_chromium

from tacdata.recording import read_session
from tacdata.studio.wizard.server import wizard_server
from tacdata.studio.wizard.wizard import Wizard

pytestmark = needs_chromium
STROKE = np.concatenate([np.zeros(10), np.linspace(0, 1, 20), np.ones(10), np.linspace(1, 0, 20), np.zeros(10)])
T = 0.05 * np.arange(3 * len(STROKE))
DEPTH = np.tile(STROKE, 3)
C0, C1 = 10 + DEPTH + 0.001 * np.sin(7 * T), 10 + 0.6 * DEPTH + 0.001 * np.cos(9 * T)


def written(path, header, *columns, between=","):
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [between.join(str(value) for value in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([header, *rows]), encoding="cp1252")
    return path


def german(folder):
    """Commas, a heading of the bench, a height, a temperature that no name tells."""
    numbers = [[f"{value:.4f}".replace(".", ",") for value in column] for column in (T, 31.2 - DEPTH, C0, C1, 21 + T)]
    return written(folder / "lauf.csv", "Prüfstand 7\n\nZeit (s);Arm (mm);K1;K2;Ofen", *numbers, between=";")


def untimed(folder):
    return written(folder / "log.csv", "depth (mm),cap1", DEPTH, C0)


def in_metres(folder):
    for run in (1, 2):
        written(folder / f"trial_{run}" / "skin.csv", "timestamp,taxel_0,taxel_1", T, C0, C1)
        written(folder / f"trial_{run}" / "robot.csv", "timestamp,tcp_z", T, 0.2 - 0.001 * DEPTH)
    return folder


def sheets(folder):
    book = openpyxl.Workbook()
    for number in (1, 2):
        sheet = book.create_sheet(f"Run {number}")
        for row in (("Time (s)", "Depth (mm)", "C1 (pF)"), *zip(T, DEPTH, C0, strict=True)):
            sheet.append([value if isinstance(value, str) else float(value) for value in row])
    del book["Sheet"]
    book.save(folder / "test.xlsx")
    return folder / "test.xlsx"


def with_dropouts(folder):
    depth = DEPTH.copy()
    depth[35::70] = 0.0
    return written(folder / "run.csv", "t (s),depth (mm),a,b", T, depth, C0, C1)


def array(folder):
    np.save(folder / "log.npy", np.column_stack([T, DEPTH, C0, C1]))
    return folder / "log.npy"


def opened(browser, address, width, faults, *, dark=False):
    context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme="dark" if dark else "light")
    page = context.new_page()
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("console", lambda message: faults.extend([message.text] if message.type == "error" else []))
    page.on("request", lambda request: faults.extend([] if request.url.startswith(address) else [request.url]))
    page.goto(address)
    page.wait_for_selector("#status:not(:text-is('reading'))")
    return page


@pytest.fixture
def faults():
    """Errors of the page, and requests to another address."""
    found = []
    yield found
    assert not found


@pytest.mark.parametrize(
    ("make", "sentence"),
    (
        (german, "3 recordings of 70 rows"),
        (untimed, "3 recordings"),
        (in_metres, "2 of 2 sets of files hold"),
        (sheets, "2 of 2 sets of files hold"),
        (with_dropouts, "3 recordings"),
        (array, "Nothing is imported yet."),
    ),
)
def test_files_of_six_kinds_fit_every_window(browser, faults, tmp_path, make, sentence):
    with wizard_server(Wizard.of(make(tmp_path), tmp_path / "m.yaml", tmp_path / "s"), 0) as address:
        for width, dark in ((360, False), (1000, True), (1600, False)):
            page = opened(browser, address, width, faults, dark=dark)
            assert sentence in page.inner_text("#sentence")
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert page.locator(".column").count() > 1
            assert not page.locator("#cut").is_visible(), "the proposal cuts presses itself"
            assert page.locator("#path").is_visible() == (make is not array)
            shown = page.evaluate("getComputedStyle(document.body).backgroundColor")
            assert (shown == "rgb(21, 25, 29)") == dark
            page.context.close()


def test_a_strange_file_becomes_a_session_by_clicks(browser, faults, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wizard = Wizard.of(german(tmp_path), tmp_path / "m.yaml", tmp_path / "s")
    with wizard_server(wizard, 0) as address:
        page = opened(browser, address, 1000, faults)
        page.get_by_label("role of Ofen").select_option(label="temperature")
        page.wait_for_selector("#sentence:has-text('2 channels')")
        assert "3 recordings of" in page.inner_text("#sentence")
        assert "3 presses found" in page.inner_text("#path figcaption")
        assert page.locator("#which").inner_text().startswith("press 1")
        page.get_by_role("button", name="Write, import and check").click()
        page.wait_for_selector("#result:has-text('3 recordings in')", timeout=60000)
        assert page.inner_text("#result code").startswith("tacdata import ")
        page.click("#judge")
        page.wait_for_selector("#verdict:not(:empty)", timeout=120000)
        page.context.close()
    assert len(read_session(tmp_path / "s").episodes) == 3
    assert yaml.safe_load((tmp_path / "m.yaml").read_text())["measured"]["temperature"]["columns"] == ["Ofen"]


def test_an_answer_changes_the_presses_and_a_file_is_kept(browser, faults, tmp_path):
    (tmp_path / "m.yaml").write_text("mine")
    with wizard_server(Wizard.of(in_metres(tmp_path / "in"), tmp_path / "m.yaml", tmp_path / "s"), 0) as address:
        page = opened(browser, address, 1000, faults)
        assert "pressed 1 mm deep" in page.inner_text("#sentence")
        card = page.locator(".card", has_text="no unit is given; m is a guess")
        assert card.get_by_role("button", name="m", exact=True).get_attribute("aria-pressed") == "true"
        card.get_by_role("button", name="cm", exact=True).click()
        page.wait_for_selector("#faults:has-text('press_above 0.1 mm, the deepest is 0.010 mm')")
        card.get_by_role("button", name="m", exact=True).click()
        page.wait_for_selector("#sentence:has-text('pressed 1 mm deep')")
        page.get_by_role("button", name="turn the sign of tcp_z").click()
        page.wait_for_selector("#text:has-text('scale: -1.0')", state="attached")
        page.get_by_role("button", name="Write the mapping").click()
        page.wait_for_selector("#question:has-text('exists. Replace it?')")
        page.get_by_role("button", name="keep it").click()
        assert (tmp_path / "m.yaml").read_text() == "mine"
        page.context.close()
