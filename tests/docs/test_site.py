"""The site's hook: the menu, the summaries for language models, and lists as the host of the clone shows them."""

import importlib.util
from pathlib import Path

import pytest

pytest.importorskip("mkdocs")
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def site():
    spec = importlib.util.spec_from_file_location("site_hook", ROOT / ".dev" / "site.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_menu_has_every_page_of_the_docs(site):
    listed = {page for entry in site.menu() for value in entry.values() for page in _paths(value)}
    assert not {page.as_posix() for page in site.pages() if page.parts[0] == "docs"} - listed - {"docs/README.md"}


def _paths(entry):
    return [entry] if isinstance(entry, str) else [path for child in entry for path in child.values()]


def test_every_line_for_language_models_has_a_summary(site):
    lines = [line for line in site.llms().splitlines() if line.startswith("- ")]
    assert len(lines) > 60
    assert not [line for line in lines if line.endswith(": ")]


@pytest.mark.parametrize(
    "text, spaced",
    [
        ("Two:\n- one\n- two", "Two:\n\n- one\n- two"),
        ("- one\n  more\n- two", "- one\n  more\n- two"),
        ("```\nA:\n- one\n```", "```\nA:\n- one\n```"),
    ],
)
def test_lists_begin_behind_an_empty_line(site, text, spaced):
    assert site.on_page_markdown(text) == spaced


def test_the_page_of_the_python_interface_has_every_public_name():
    import tacdata

    text = (ROOT / "docs" / "reference" / "python.md").read_text()
    assert {line.split("td.")[1] for line in text.splitlines() if "heading: td." in line} == set(tacdata._NAMES)
