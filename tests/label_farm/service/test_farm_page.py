"""The page in a real browser: Debian's Chromium, without a head."""

import os

import pytest
from chaos import Service, record
from gate import Gate
from running.chromium import needs_chromium

pytestmark = needs_chromium
TOKEN = "0123456789abcdef0123"


@pytest.fixture(scope="module")
def idle(tmp_path_factory):
    """A service that has nothing to solve, and a folder that is no session."""
    folder = tmp_path_factory.mktemp("idle")
    (folder / "empty").mkdir()
    with Service(folder, workers=0, options=("--token", TOKEN)) as service:
        yield service


@pytest.fixture
def gate(tmp_path):
    """Nothing is solved before the test opens it."""
    return Gate(tmp_path / "gate")


@pytest.fixture
def busy(tmp_path, gate):
    """A service with a worker and two sessions, made for one test: a second try begins like the first."""
    record(tmp_path, 2, 6)
    options = ("--token", TOKEN)
    with Service(tmp_path, 1, seconds=0.0, options=options, gate=gate, FAST_MODEL_FAILS="-5.95") as service:
        yield service


@pytest.fixture
def idle_page(browser, idle):
    """The page of the service that has nothing to solve."""
    yield from shown(browser, idle)


@pytest.fixture
def busy_page(browser, busy):
    """The page of the service with two sessions."""
    yield from shown(browser, busy)


def shown(browser, service):
    """Open a service's page; it must end without an error in its script."""
    opened = browser.new_page(viewport={"width": 1100, "height": 900})
    faults = []
    opened.on("pageerror", lambda error: faults.append(str(error)))
    opened.set_default_timeout(120_000)
    opened.goto(service.url)
    yield opened
    opened.close()
    assert not faults


def log_in(page):
    page.fill("#token", TOKEN)
    page.click("#login button")
    page.wait_for_selector("#main:visible")


def test_the_page_asks_for_the_token_first(idle_page):
    page = idle_page
    page.wait_for_selector("#login:visible")
    assert not page.is_visible("#main")
    page.fill("#token", "wrong")
    page.click("#login button")
    page.wait_for_selector("#problem:has-text('a wrong token')")
    assert not page.is_visible("#main")


def test_a_person_submits_watches_and_cancels(busy_page, gate):
    page = busy_page
    log_in(page)
    for name in ("session-0", "session-1"):
        page.fill("[name=session]", name)
        page.fill("[name=by]", "ann <b>")
        page.click("#submit button")
        page.wait_for_selector(f"#submissions tr:has-text('{name}')")
    assert page.inner_text("tr[data-id='000001'] td:nth-child(3)") == "ann <b>", "words of others are shown as words"
    page.click("tr[data-id='000001'] button.up")
    page.wait_for_selector("tr[data-id='000001'] td.n:text-is('1')")
    page.on("dialog", lambda dialog: dialog.accept())
    page.click("tr[data-id='000002'] button.cancel")
    page.wait_for_selector("tr[data-id='000002'] .cancelled")
    gate.open()
    page.wait_for_selector("tr[data-id='000001'] .done")
    assert "5 of 6, 1 failed" in page.inner_text("tr[data-id='000001']")
    assert "1 failed" in page.inner_text("#summary")
    page.wait_for_selector("#maps figure:nth-of-type(5)")
    images = "[...document.querySelectorAll('#maps img')]"
    page.wait_for_function(f"{images}.length === 5 && {images}.every(image => image.naturalWidth === {35 * 6})")
    page.click("#maps figure")
    page.wait_for_selector("#job:has-text('press solved')")
    told = page.inner_text("#job").splitlines()
    assert told[0].startswith("000001 session-0, episode") and "by worker" in told[2] and "states, deepest" in told[4]
    assert "no equilibrium" in page.inner_text("#failures summary")
    page.click("#failures summary")
    assert "next:" in page.inner_text("#failures details")
    page.wait_for_selector("#failures pre:has-text('Traceback')")
    row = page.inner_text("#workers tbody tr").split("\t")
    assert row[1] == "cpu" and int(row[2]) >= 5 and float(row[4]) > 10
    page.wait_for_selector("#workers tbody td:nth-child(7):has-text('MB')")
    page.wait_for_selector("#workers tbody td:nth-child(6):has-text('%')")
    page.wait_for_selector("#throughput-words:has-text('5 presses solved and 1 failed')")
    page.wait_for_selector("#throughput canvas")
    page.locator("#throughput .u-over").hover()
    page.wait_for_selector("#throughput .read:has-text('minutes from now')")
    page.wait_for_selector("#failures img.press[src^=blob]")
    page.wait_for_function("document.querySelector('#failures img.press').naturalWidth > 900")
    if folder := os.environ.get("TACDATA_SCREENSHOTS"):
        page.screenshot(path=f"{folder}/farm.png", full_page=True)
    page.click("#submissions a:text-is('000002')")
    page.wait_for_selector("#one:visible")
    assert page.locator("#submissions tbody tr").count() == 1 and not page.locator("#failures details").count()
    page.goto(page.url.split("#")[0] + "docs")
    assert "/api/submissions/{number}/cancel" in page.inner_text("table")


def test_what_is_refused_is_said_on_the_page(idle_page, idle):
    page = idle_page
    log_in(page)
    page.fill("[name=session]", "../elsewhere")
    page.fill("[name=by]", "eve")
    page.click("#submit button")
    page.wait_for_selector("#refusal:has-text('a path inside the folder')")
    for _ in range(2):
        page.wait_for_event("response", lambda answer: answer.url.endswith("/api/state"))
    assert "a path inside the folder" in page.inner_text("#refusal"), "it stays while the page goes on asking"
    idle.client(TOKEN).post("/api/submissions", {"session": "empty", "by": "eve"})
    page.wait_for_selector("#submissions .refused")
    assert "session.json" in page.inner_text("#submissions tr:has-text('empty')")
