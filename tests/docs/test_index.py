"""Whoever looks for a page or a term finds it: the index names every page, the glossary is sorted and short."""

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = sorted(page.relative_to(DOCS).as_posix() for page in DOCS.glob("*/*.md") if page.parent.name != "decisions")
GROUPS = re.split(r"^## ", (DOCS / "reference" / "glossary.md").read_text(), flags=re.MULTILINE)[1:]


@pytest.mark.parametrize("page", PAGES)
def test_the_index_names_every_page(page):
    assert f"({page})" in (DOCS / "README.md").read_text()


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.split("\n")[0])
def test_terms_are_sorted_and_said_in_a_line(group):
    lines = [line for line in group.split("\n")[1:] if line]
    terms = [re.match(r"- \*\*(.+?)\*\*(?: °)?: ", line)[1] for line in lines]
    assert len(terms) > 3
    assert [term.lower() for term in terms] == sorted(term.lower() for term in terms)
    assert max(len(re.sub(r"\]\(.*?\)", "", line)) for line in lines) <= 120


def test_no_term_stands_in_two_groups():
    terms = [term for group in GROUPS for term in re.findall(r"^- \*\*(.+?)\*\*", group, re.MULTILINE)]
    assert len(terms) == len(set(terms))
