"""The hook of mkdocs.yml: pages from all over the clone, the menu, and what programs read instead of HTML.

Every Markdown file of the clone is a page at its own path, so links work on the site as they do in the clone. The
menu comes from `docs/README.md`. Each page has a twin in Markdown beside it (`look.html`, `look.md`), and `llms.txt`
lists them.
"""

import ast
import re
from pathlib import Path

import griffe
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]
INDEX = ROOT / "docs" / "README.md"
FOLDERS = ("docs", "examples", "benchmarks", "schemas", "tacdata", "label_farm", "training", "viewers")
LINK = re.compile(r"\]\(([^)#\s]+)")
FENCE = re.compile(r"^(```.*?^```)", re.MULTILINE | re.DOTALL)
ITEM = re.compile(r"(- |\d+\. )")
"""The beginning of an item of a list."""
PARAGRAPH = re.compile(r"^(?=[A-Za-z0-9`*\[])(?!:::).+?(?=\n\n|\Z)", re.MULTILINE | re.DOTALL)
"""One of sentences: neither heading, table, list, picture nor directive."""
DIRECTIVE = "\n::: "
"""Begins the name of an object whose docstring mkdocstrings puts in place."""
LONGEST_SUMMARY = 160
"""Characters of a page's line in llms.txt."""


class Examples(griffe.Extension):
    """Docstrings begin their examples with `Example:`; griffe knows `Examples:`."""

    def on_object(self, *, obj, **_):
        """Write it as griffe knows it."""
        if obj.docstring is not None:
            obj.docstring.value = re.sub(r"^Example:$", "Examples:", obj.docstring.value, flags=re.MULTILINE)


def pages():
    """Return all pages, as paths below the clone."""
    found = [*ROOT.glob("*.md"), *(page for folder in FOLDERS for page in (ROOT / folder).rglob("*.md"))]
    return sorted(page.relative_to(ROOT) for page in found)


def title(page):
    """Return a page's heading without its markup."""
    heading = re.search(r"^# (.+)$", (ROOT / page).read_text(), re.MULTILINE)
    return heading[1].replace("`", "")


def sections():
    """Yield (heading, pages) of the index, in its order; decisions are listed one by one."""
    for section in re.split(r"^## ", INDEX.read_text(), flags=re.MULTILINE)[1:]:
        targets = [(INDEX.parent / link).resolve() for link in LINK.findall(section) if "//" not in link]
        listed = [target.relative_to(ROOT) for target in targets if target.suffix == ".md"]
        yield section.split("\n")[0].split(":")[0], list(dict.fromkeys(listed))


def menu():
    """Return the menu as mkdocs takes it."""
    entries = [{"Home": "README.md"}]
    for heading, listed in sections():
        entries.append({heading: [{title(page): page.as_posix()} for page in listed]})
    decisions = [page for page in pages() if page.parts[:2] == ("docs", "decisions")]
    entries.append({"Decisions": [{title(page): page.as_posix()} for page in sorted(decisions, key=_index_first)]})
    entries.append({"Rooms": [{room: f"{room}/README.md"} for room in _rooms()]})
    return entries


def _index_first(page):
    return page.name != "README.md", page.name


def _rooms():
    rooms = re.findall(r"^\| `([\w/]+)` \|", (ROOT / "ARCHITECTURE.md").read_text(), re.MULTILINE)
    return [room for room in rooms if (ROOT / room / "README.md").exists()]


def on_config(config):
    """Set the menu."""
    config.nav = menu()
    return config


def on_files(files, config):
    """Take the pages and whatever they link to; keep what belongs to the theme."""
    kept = [file for file in files if not Path(file.abs_src_path or "").is_relative_to(ROOT / "docs")]
    linked = {ROOT / "docs" / "site.css"}
    for page in pages():
        text = FENCE.sub("", (ROOT / page).read_text())
        targets = ((ROOT / page).parent / link for link in LINK.findall(text) if "//" not in link)
        linked |= {target.resolve() for target in targets if target.is_file()}
    paths = {*pages(), *(path.relative_to(ROOT) for path in linked)}
    added = [File.generated(config, _address(path), abs_src_path=str(ROOT / path)) for path in sorted(paths)]
    return Files([*kept, *added])


def _address(path):
    return "site.css" if path.name == "site.css" else path.as_posix()


def on_page_markdown(markdown, **_):
    """Put an empty line before each list, as Markdown does on the host of the clone."""
    parts = FENCE.split(markdown)
    return "".join(part if part.startswith("```") else _spaced(part) for part in parts)


def _spaced(text):
    lines, in_list = [], False
    for line in text.split("\n"):
        item = bool(ITEM.match(line))
        if item and not in_list and lines and lines[-1].strip():
            lines.append("")
        in_list = item or (in_list and bool(line.strip()))
        lines.append(line)
    return "\n".join(lines)


def on_page_content(html, page, **_):
    """Keep the text of pages made from docstrings: their source holds only names."""
    if DIRECTIVE in page.file.content_string:
        from markdownify import markdownify

        TWINS[page.file.src_uri] = markdownify(html, heading_style="ATX", code_language="python")
    return html


TWINS: dict[str, str] = {}
"""Markdown of the pages made from docstrings, by their path."""


def on_post_build(config):
    """Write a twin in Markdown of each page, and the list of them."""
    site = Path(config.site_dir)
    for page in pages():
        twin = site / page
        twin.parent.mkdir(parents=True, exist_ok=True)
        twin.write_text(TWINS.get(page.as_posix(), (ROOT / page).read_text()))
    (site / "llms.txt").write_text(llms())


def llms():
    """Return the list of pages for language models (llmstxt.org): name, summary, and one line a page."""
    lines = ["# tacdata", "", f"> {summary(Path('README.md'))}"]
    decisions = [page for page in pages() if page.parts[:2] == ("docs", "decisions") and page.name != "README.md"]
    rooms = [Path(room, "README.md") for room in _rooms()]
    for heading, listed in [*sections(), ("Rooms", rooms), ("Optional", decisions)]:
        lines += ["", f"## {heading}", ""]
        lines += [f"- [{title(page)}]({page.as_posix()}): {summary(page)}" for page in listed]
    return "\n".join(lines) + "\n"


def summary(page):
    """Return the first sentence of a page, or of the docstring of a room that has no sentence."""
    text = FENCE.sub("", (ROOT / page).read_text()).partition("\n")[2]
    source = ROOT / page.parent / "__init__.py"
    if paragraph := PARAGRAPH.search(text):
        words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", " ".join(paragraph[0].split()))
        words = re.split(r"(?<=[.])\s", words)[0].rstrip(":")
    else:
        words = (ast.get_docstring(ast.parse(source.read_text())) or "").split("\n")[0] if source.exists() else ""
    return words if len(words) <= LONGEST_SUMMARY else words[:LONGEST_SUMMARY].rpartition(" ")[0] + " …"
