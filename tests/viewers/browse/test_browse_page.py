"""The page of episodes as a person uses it, in headless Chromium; a page that grabs the keyboard stands for Rerun's."""

import os
import socketserver
import threading
from http.server import BaseHTTPRequestHandler

import pytest
from running.chromium import needs_chromium

from tacdata.dataset.flags import read_flags, read_history
from tacdata.dataset.notes import read_notes
from tacdata.viewers.browse.episode_list import Entry, EpisodeList
from tacdata.viewers.browse.server import Pages, Times, serving

pytestmark = needs_chromium
COUNT, BEGIN = 30, 1_795_674_713_000_000_000
GRABBING = b"""<!doctype html><canvas tabindex="0" id="c" style="width:100%;height:100%"></canvas><script>
const c = document.getElementById("c"); c.focus(); setTimeout(() => { c.focus(); fetch("/grabbed"); }, 100);
onkeydown = () => { document.title = "pressed"; };
let at = new URLSearchParams(location.search).get("at"); const tell = () => {
  const [line, ns] = at.split("@"); parent.postMessage({moment: {line, ns}}, "*"); };
setTimeout(() => {
  onmessage = e => { at = e.data.at; tell(); };
  parent.postMessage({ready: true}, "*");
}, 300);
</script>"""


class Grabber(BaseHTTPRequestHandler):
    grabbed: threading.Semaphore

    def do_GET(self):
        if self.path == "/grabbed":
            self.grabbed.release()
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(GRABBING)

    def log_message(self, *_):
        pass


class Quick(Pages):
    """Draws nothing, as soon as it may."""

    may_draw = None

    def episode(self, number):
        self.may_draw.wait(20.0)
        self.listed.numbered(number)
        return self._folder / "empty.rrd", Times("host_time", BEGIN, BEGIN + 2_500_000_000)


@pytest.fixture
def served(tmp_path):
    entries = []
    for k in range(COUNT):
        name = f"episode-{k:06d}.mcap"
        (tmp_path / name).write_text(name)
        entries.append(
            Entry(
                k,
                name,
                "ball" if k % 2 else "pin",
                "sphere",
                0.1 * k,
                0.0,
                0.4 + 0.05 * k,
                1.0,
                0.95,
                "complete",
                "test",
                0.01 * k,
            )
        )
    (tmp_path / "empty.rrd").write_bytes(b"")
    grabbed = threading.Semaphore(0)
    handler = type("Counted", (Grabber,), {"grabbed": grabbed})
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), handler) as viewer:
        threading.Thread(target=viewer.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{viewer.server_address[1]}"
        pages = Quick(EpisodeList(tmp_path, "session", tuple(entries)), None, None, tmp_path, address)
        pages.grabbed, pages.may_draw = grabbed, threading.Event()
        pages.may_draw.set()
        with serving(pages, 0):
            yield pages
        viewer.shutdown()


@pytest.fixture
def page(browser, served):
    context = browser.new_context(viewport={"width": 1400, "height": 800})
    opened = context.new_page()
    faults = []
    opened.on("pageerror", lambda error: faults.append(str(error)))
    opened.set_default_timeout(120_000)
    opened.goto(served.address + "/")
    opened.wait_for_function(f"document.querySelectorAll('tbody tr').length === {COUNT}")
    yield opened
    context.close()
    assert not faults


def write(page, field, text):
    """Fill a field. A viewer that loads takes the keyboard for a moment, and may take the text: then again."""
    for _ in range(10):
        page.fill(field, text)
        if page.input_value(field) == text:
            return
    raise AssertionError(f"{field} does not take {text!r}")


def opened(page):
    return int(page.inner_text("tr.open td:first-child"))


def press_and_see(page, served, key, wanted):
    """Press a key once the viewer of the row before has loaded and grabbed; wait until another row is open."""
    assert served.grabbed.acquire(timeout=60), "the viewer has loaded and taken the focus, twice"
    page.wait_for_function("document.activeElement !== document.querySelector('iframe')")
    page.keyboard.press(key)
    page.wait_for_function(f"document.querySelector('tr.open td').textContent === '{wanted}'")


def test_arrow_keys_work_although_the_viewer_grabs_the_keyboard(page, served):
    for wanted in (1, 2, 3):
        press_and_see(page, served, "ArrowDown", wanted)
    # A viewer that is still loading would forget the key that the viewer before it was given.
    assert served.grabbed.acquire(timeout=60)
    page.mouse.move(1000, 400)  # over the viewer the keys are the viewer's
    page.mouse.click(1000, 400)
    page.keyboard.press("ArrowDown")
    page.frames[1].wait_for_function("document.title === 'pressed'")
    assert opened(page) == 3
    page.mouse.move(200, 500)
    page.wait_for_function("document.activeElement !== document.querySelector('iframe')")
    page.keyboard.press("ArrowUp")
    page.wait_for_function("document.querySelector('tr.open td').textContent === '2'")


def test_a_viewer_that_loads_gives_the_keyboard_back_to_the_field_one_types_in(page, served):
    assert served.grabbed.acquire(timeout=60)
    page.wait_for_function("document.activeElement !== document.querySelector('iframe')")
    page.focus("#filter")
    page.evaluate("location.hash = '#episode=7'")
    page.wait_for_function("document.querySelector('tr.open td').textContent === '7'")
    assert served.grabbed.acquire(timeout=60), "the next viewer has loaded and taken the focus, twice"
    page.wait_for_function("document.activeElement === document.querySelector('#filter')", timeout=20_000)
    page.keyboard.type("depth>0.5")
    assert page.input_value("#filter") == "depth>0.5"


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        ("depht>1", "no column depht: there are number, flag, error"),
        ("depth>deep", "depth is a number"),
        ("indenter>ball", "indenter is a text"),
        ("depth>0.5 eror<1", "no column eror"),
    ],
)
def test_a_typo_in_a_filter_is_named_and_hides_nothing(page, typed, words):
    write(page, "#filter", typed)
    page.wait_for_function("words => document.querySelector('#wrong').innerText.includes(words)", arg=words)
    assert page.locator("tbody tr").count() == (COUNT if "depth>0.5" not in typed else COUNT - 3)
    write(page, "#filter", "depth>0.8 indenter=ball")
    assert not page.is_visible("#wrong") and page.locator("tbody tr").count() == 11


def test_a_filter_that_finds_nothing_says_which_values_there_are_and_values_are_offered(page):
    write(page, "#filter", "indenter=ring depth>9")
    page.wait_for_function("document.querySelector('#wrong').innerText.includes('no episode fits')")
    assert "indenter is ball, pin" in page.inner_text("#wrong")
    assert "depth is 0.4 to 1.85 mm" in page.inner_text("#wrong")
    write(page, "#filter", "depth>0.8 ")
    offered = page.eval_on_selector_all("#conditions option", "options => options.map(o => o.value)")
    assert {"depth>0.8 indenter=pin", "depth>0.8 error<=0.29"} <= set(offered)


@pytest.mark.parametrize("width", [360, 1000, 2000])
def test_no_column_is_out_of_reach(page, width):
    page.set_viewport_size({"width": width, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.locator("tbody tr:first-child td").last.scroll_into_view_if_needed()
    box, side = (page.locator(q).first.bounding_box() for q in ("tbody tr:first-child td:last-child", "#side"))
    assert box["x"] + box["width"] <= side["x"] + side["width"] + 1


def test_the_flag_is_seen_at_1400_px_and_columns_are_chosen(page, tmp_path):
    write(page, "#reason", "the tool slipped")
    page.click("#flag")
    page.wait_for_selector("td.flag:has-text('slipped')")
    box = page.locator("tr.open td.flag").bounding_box()
    side = page.locator("#side").bounding_box()
    assert box["x"] + box["width"] <= side["x"] + side["width"], "inside the list without scrolling"
    page.click("#side > #tools > details:first-of-type > summary")
    page.uncheck("#show-indenter")
    heads = page.locator("th").all_inner_texts()
    assert not any("indenter" in head for head in heads) and heads[:2] == ["number", "flag"]
    page.reload()
    page.wait_for_selector("tbody tr")
    assert not any("indenter" in head for head in page.locator("th").all_inner_texts()), "remembered"


def test_several_rows_are_flagged_at_once_and_the_history_tells_who(page, served):
    page.click("tbody tr:nth-child(3)")
    page.click("tbody tr:nth-child(6)", modifiers=["Shift"])
    page.click("tbody tr:nth-child(9)", modifiers=["Control"])
    write(page, "#reason", "rig was moved")
    page.click("#flag")
    page.wait_for_function("document.querySelectorAll('tr.flagged').length === 5")
    flags = read_flags(served.listed.root)
    assert sorted(flag.file[8:14] for flag in flags.values()) == ["000002", "000003", "000004", "000005", "000008"]
    page.click("tbody tr:nth-child(3)")
    page.click("#unflag")
    page.wait_for_function("document.querySelectorAll('tr.flagged').length === 4")
    page.click("#past > summary")
    page.wait_for_function("document.querySelector('#history').textContent.includes('taken back')")
    told = page.inner_text("#history").splitlines()
    assert len(told) == 6 and "episode-000002.mcap taken back" in told[0] and "@" in told[0]
    history = read_history(served.listed.root)
    assert [change.reason for change in history] == ["rig was moved"] * 5 + [""]


def test_shift_and_an_arrow_choose_rows_and_an_arrow_alone_lets_them_go(page, served):
    press_and_see(page, served, "ArrowDown", 1)
    press_and_see(page, served, "Shift+ArrowDown", 2)
    press_and_see(page, served, "Shift+ArrowDown", 3)
    write(page, "#reason", "rig was moved")
    page.click("#flag")
    page.wait_for_function("document.querySelectorAll('tr.flagged').length === 3")
    page.focus("#rows")
    press_and_see(page, served, "Shift+ArrowDown", 4)
    press_and_see(page, served, "ArrowDown", 5)
    write(page, "#reason", "slipped")
    page.click("#flag")
    page.wait_for_function("document.querySelectorAll('tr.flagged').length === 4")
    flagged = sorted(flag.file[8:14] for flag in read_flags(served.listed.root).values())
    assert flagged == ["000001", "000002", "000003", "000005"]


def test_what_is_said_while_an_episode_is_drawn_stays(page, served):
    served.may_draw.clear()
    page.click("tbody tr:nth-child(4)")
    assert page.inner_text("#said") == "drawing …"
    page.click("#marks > summary")
    page.click("#write")
    served.may_draw.set()
    page.wait_for_function("document.querySelector('iframe').src.includes('3.rrd')")
    assert "from when to when" in page.inner_text("#said")
    page.click("tbody tr:nth-child(5)")
    page.wait_for_selector("#said:empty", state="attached")


def test_a_stretch_is_noted_and_the_note_taken_away(page, served):
    page.click("tbody tr:nth-child(4)")
    page.click("#marks > summary")
    page.click("#write")
    assert "from when to when" in page.inner_text("#said")
    for begin, end, text in (("2", "1", "wrong way"), ("1.5", "2.25", "the tool <b>slips")):
        write(page, "#begin", begin)
        write(page, "#end", end)
        write(page, "#note", text)
        page.click("#write")
        answer = "2 to 1 s" if begin == "2" else "noted: episode-000003"
        page.wait_for_selector(f"#said:has-text('{answer}')")
    assert page.inner_text("#notes span") == "1.5 to 2.25 s: the tool <b>slips", "words of others are shown as words"
    assert "@" in page.get_attribute("#notes span", "title")
    assert page.inner_text("tr.open td:nth-child(4)") == "1" and "notes" in page.locator("th").nth(3).inner_text()
    [note] = read_notes(served.listed.root)
    assert (note.file, note.begin, note.end) == ("episode-000003.mcap", 1.5, 2.25)
    if folder := os.environ.get("TACDATA_SCREENSHOTS"):
        page.screenshot(path=f"{folder}/browse.png")
    page.click("#notes button")
    page.wait_for_selector("#said:has-text('taken away')")
    assert not read_notes(served.listed.root) and not page.locator("#notes span").count()


@pytest.mark.parametrize(("link", "seconds"), [("#episode=17", "2.500"), ("#episode=17&at=1.25", "1.250")])
def test_a_link_opens_an_episode_at_its_deepest_or_at_a_moment(page, served, link, seconds):
    page.goto("about:blank")
    page.goto(served.address + "/" + link)
    page.wait_for_function("document.querySelector('tr.open td') !== null")
    assert opened(page) == 17
    assert page.evaluate("location.hash") == link
    shown = "wanted => document.querySelector('#at').value === wanted"
    page.wait_for_function(shown, arg=seconds)
    write(page, "#at", "0.75")
    page.click("#go")
    page.wait_for_function("location.hash === '#episode=17&at=0.75'")
    page.click("#deepest")
    page.wait_for_function(shown, arg="2.500")
    assert page.evaluate("location.hash") == "#episode=17"
    page.click("#link")
    page.wait_for_selector("#said:has-text('#episode=17&at=2.5')")
