"""What a page is made of: numbers in print, tables, figures as data."""

import json
import re

import numpy as np
import pytest

from tacdata.errors import UsageError
from tacdata.pages import Cell, HtmlPage, Items, PageHeader, Paragraph, Plot, Series, Shares, Table
from tacdata.pages.plot import MOST_POINTS


def page(*blocks, **head):
    made = HtmlPage(PageHeader("Kind", "It is so.", **head))
    made.add("Part", *blocks)
    return made.text


def figure(text):
    return json.loads(re.search(r'<script type="application/json">(.*?)</script>', text)[1])[0]


def test_a_number_that_is_none_is_a_dash_and_never_nan():
    rows = [(float("nan"), None), (np.float32("nan"), Cell(float("inf")))]
    text = page(Table(("a", "b"), rows), Plot("t", "x", "y", [Series("s", [1.0, np.nan])], [0.0, 1.0]))
    assert text.count(">–<") == 4
    assert figure(text)["series"][0]["values"] == [1.0, None]
    assert "nan" not in re.sub(r"<(script|style)>.*?</\1>", "", text, flags=re.S).lower()


@pytest.mark.parametrize("words", ["5f21e34420e3", "1-2 sheets", "none"])
def test_a_column_of_words_that_begin_with_digits_is_one_of_words(words):
    values = [(words, "−1.5 mm (−2 to 0)", "< 0.001", 3.5)]
    assert Table("abcd", values).numeric == [False, True, True, True]


def test_words_of_others_are_words_and_commands_are_code():
    text = page(Paragraph("a <b> `tacdata check x<y`"), Items(["`plain`"]), of="<i>", next=["run `tacdata view v`"])
    assert "a &lt;b&gt;" in text and "&lt;i&gt;" in text
    assert '<code class="command">tacdata check x&lt;y</code>' in text and "<code>plain</code>" in text
    name = "</script><script>alert(1)</script>"
    drawn = page(Plot(name, "x", "y", [Series(name, [1.0])], [0.0]))
    assert "alert(1)</script>" not in drawn and figure(drawn)["title"] == name


def test_a_curve_keeps_its_ends_and_few_points():
    x = np.arange(5000.0)
    document = Plot("t", "x", "y", [Series("s", 2 * x), Series("own", x[:9], x=x[:9])], x).document
    places, first, second = document["x"]["values"], *(one["values"] for one in document["series"])
    assert len(places) == len(first) == MOST_POINTS and (places[0], places[-1]) == (0, 4999)
    assert (first == 2 * places).all() and len(second) == 9


def test_a_series_of_another_length_is_refused():
    with pytest.raises(UsageError, match="3 values at 2 places"):
        _ = Plot("t", "x", "y", [Series("s", [1.0, 2.0, 3.0])], [0.0, 1.0]).data


def test_shares_fill_the_bar():
    assert [width for _, _, width in Shares([("a", 0.6), ("b", 0.3)]).widths] == pytest.approx([66.67, 33.33], abs=0.01)


def test_a_page_without_data_is_small():
    assert len(page(Paragraph("x"))) < 25_000
    assert len(page(Plot("t", "x", "y", [Series("s", [1.0])], [0.0]))) < 100_000


def test_a_page_has_its_contents_listed_where_it_is_long():
    made = HtmlPage(PageHeader("Kind", "It is so."))
    for k in range(5):
        assert ("<nav" in made.text) is False
        made.add(f"Part {k}", Paragraph("x"))
    assert '<a href="#part-5">Part 4</a>' in made.text
    made.add("Empty", None)
    assert "Empty" not in made.text
