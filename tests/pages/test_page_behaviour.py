"""A page in a browser: figures answer, tables sort and filter, commands are copied, nothing is asked of a network."""

from pathlib import Path

import numpy as np
import pytest
from running.chromium import needs_chromium

from tacdata.pages import HtmlPage, PageHeader, Paragraph, PixelMap, Plot, Series, Slider, Table

pytestmark = needs_chromium
X = np.arange(11.0)
INK = """(() => { const c = document.querySelector('figure canvas');
  return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.reduce((a, b) => a + b); })"""
"""Sum of the first figure's colours, as JavaScript."""
ROWS = [(f"row {k}", float(k)) for k in (3, 20, 1, None, 7, 5, 9, 11, 2, 4) if k is not None]


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    page = HtmlPage(PageHeader("Kind", "It is so.", next=["then `tacdata view here --web`"]))
    curves = [Series("measured", X**2, "ink"), Series("model", 2 * X)]
    page.add(
        "Curves",
        Plot("a", "time [s]", "y [mm]", curves, X, link="one"),
        Plot("b", "time [s]", "y", curves, X, link="one"),
    )
    page.add("Loop", Plot("loop", "depth [mm]", "y", [Series("way", [0.0, 1.0, 4.0], x=[0.0, 2.0, 1.0])]))
    page.add("Rows", Table(("name", "value"), [*ROWS, ("none", None)]))
    frames = [Plot(f"of {k}", "x", "y", [Series("s", k * X)], X) for k in (1, 2)]
    page.add("Presses", Slider("press", ["first", "second"], [frames]))
    page.add("Maps", *(PixelMap(n, np.arange(6.0).reshape(2, 3), "mm", 0, 5, (0, 3, 0, 2), link="m") for n in "pq"))
    page.add("Folded", Paragraph("inside"), folded=True)
    path = tmp_path_factory.mktemp("page") / "page.html"
    path.write_text(page.text)
    assert path.stat().st_size < 200_000
    return path.as_uri()


@pytest.fixture(params=[360, 1000, 2000])
def wide(request, browser, address):
    yield from _opened(browser, address, request.param)


@pytest.fixture
def page(browser, address):
    yield from _opened(browser, address, 1000)


def _opened(browser, address, width):
    context = browser.new_context(viewport={"width": width, "height": 900}, permissions=["clipboard-read"])
    opened, faults, asked = context.new_page(), [], []
    opened.on("pageerror", lambda error: faults.append(str(error)))
    opened.on("console", lambda message: faults.extend([message.text] if message.type == "error" else []))
    opened.on("request", lambda request: asked.append(request.url))
    opened.goto(address)
    opened.wait_for_selector(".uplot")
    yield opened
    context.close()
    assert not faults and asked == [address], "a page asks nothing of a network"


def figure(page, k):
    return page.locator("figure").nth(k)


def scale(page, k, name):
    """Return the ends of an axis."""
    return page.evaluate(
        """([k, name]) => {
        const {min, max} = [...tacdata.figures.drawn.values()][k].chart.scales[name]; return [min, max]; }""",
        [k, name],
    )


def hover(page, k, share):
    """Put the pointer over a figure, at a share of its width."""
    over = figure(page, k).locator(".u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    page.mouse.move(box["x"] + share * box["width"], box["y"] + box["height"] / 2)


def test_nothing_is_wider_than_the_window(wide):
    assert wide.evaluate("document.documentElement.scrollWidth") <= wide.viewport_size["width"]
    for canvas in wide.locator("figure canvas").all():
        assert canvas.bounding_box()["width"] > 150


def test_print_leaves_nothing_out_on_a4_and_puts_three_maps_in_a_row(browser, tmp_path):
    made = HtmlPage(PageHeader("Kind", "It is so.", next=["then `tacdata view here --web`"]))
    made.add("Maps", *(PixelMap(n, np.arange(6.0).reshape(2, 3), "mm", 0, 5, (0, 3, 0, 2)) for n in "pqr"))
    names = [f"a quantity with a long name, {k}" for k in range(10)]
    made.add("Wide", Table(names, [("0.123 ± 0.456",) * 10] * 2), Plot("a", "t", "y", [Series("s", X)], X))
    (tmp_path / "page.html").write_text(made.text)
    for page in _opened(browser, (tmp_path / "page.html").as_uri(), 680):  # A4 less 15 mm, 96 dots an inch
        page.emulate_media(media="print")
        page.wait_for_timeout(200)
        assert page.evaluate("document.documentElement.scrollWidth") <= 680
        assert page.evaluate("document.querySelector('table').getBoundingClientRect().right") <= 680
        boxes = [box.bounding_box() for box in page.locator("figure.map").all()]
        assert len(boxes) == 3 and {box["y"] for box in boxes} == {boxes[0]["y"]}
        assert not page.locator("figcaption .tools:visible, button.copy:visible").count()


def test_values_are_read_under_the_pointer_and_in_the_linked_figure(page):
    hover(page, 0, 0.4)
    for k in (0, 1):
        read = figure(page, k).locator(".read").inner_text()
        assert "measured 16" in read and "model 8" in read and "time [s] 4" in read
    assert "16" not in figure(page, 3).locator(".read").inner_text()
    hover(page, 2, 0.95)
    assert "depth [mm] 2, y 1" in figure(page, 2).locator(".read").inner_text()


def test_a_series_is_hidden_and_the_scale_follows(page):
    assert scale(page, 0, "y")[1] > 100
    button = figure(page, 0).locator(".read button").first
    button.click()
    assert button.get_attribute("aria-pressed") == "false" and scale(page, 0, "y")[1] < 25


def test_a_stretch_is_enlarged_in_both_linked_figures_and_the_whole_comes_back(page):
    box = figure(page, 0).locator(".u-over").bounding_box()
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 30)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 30, steps=5)
    page.mouse.up()
    assert scale(page, 0, "x") == pytest.approx([2, 6], abs=0.2) == scale(page, 1, "x")
    figure(page, 0).get_by_role("button", name="whole").click()
    assert scale(page, 0, "x") == [0, 10]


def test_a_figure_gives_its_data(page):
    with page.expect_download() as download:
        figure(page, 0).get_by_role("button", name="data").click()
    lines = Path(download.value.path()).read_text().splitlines()
    assert lines[0] == "time [s],measured,model" and lines[4] == "3,9,6" and len(lines) == 12


def test_a_slider_shows_another_press(page):
    assert figure(page, 3).locator("figcaption").inner_text().startswith("of 1")
    page.locator(".slider input").fill("1")
    assert figure(page, 3).locator("figcaption").inner_text().startswith("of 2")
    assert page.locator(".slider select").input_value() == "1"
    hover(page, 3, 0.5)
    assert "s 10" in figure(page, 3).locator(".read").inner_text()


def test_a_map_tells_the_value_in_all_maps_of_its_row(page):
    canvas = figure(page, 4).locator("canvas")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + 0.9 * box["width"], box["y"] + 0.2 * box["height"])
    for k in (4, 5):
        assert figure(page, k).locator(".read").inner_text() == "x 2.5 mm, y 1.5 mm: 5 mm"


def test_rows_are_sorted_by_number_and_what_is_unknown_comes_last(page):
    cells = lambda: page.locator("tbody tr td:last-child").all_inner_texts()  # noqa: E731
    page.get_by_role("button", name="value").click()
    assert [float(c) for c in cells()[:-1]] == sorted(k for _, k in ROWS) and cells()[-1] == "–"
    page.get_by_role("button", name="value").click()
    assert cells()[0] == "20" and cells()[-1] == "–"


def test_a_filter_that_finds_nothing_says_which_values_there_are(page):
    page.get_by_label("filter rows").fill("row 2")
    assert page.locator("tbody tr:visible").count() == 2 and "2 of 10 rows" in page.inner_text(".filter")
    page.get_by_label("filter rows").fill("elsewhere")
    assert not page.locator("tbody tr:visible").count() and "row 11" in page.inner_text(".filter")


def test_the_next_command_is_copied(page):
    page.get_by_role("button", name="copy tacdata view here --web").click()
    page.wait_for_selector("button.copy:text-is('copied')")
    assert page.evaluate("navigator.clipboard.readText()") == "tacdata view here --web"


def test_a_link_of_the_contents_opens_a_folded_part(page):
    assert not page.get_by_text("inside").is_visible()
    page.click("nav summary")
    page.click("nav a:text-is('Folded')")
    assert page.get_by_text("inside").is_visible()


def test_figures_change_with_the_scheme(page):
    light = page.evaluate(f"{INK}()")
    page.emulate_media(color_scheme="dark")
    page.wait_for_function(f"light => {INK}() !== light", arg=light)
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(21, 25, 29)"
