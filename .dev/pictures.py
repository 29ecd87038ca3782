"""Draw the pictures of the documents: `.venv/bin/python .dev/pictures.py [NAME ...]`.

A run of `tacdata demo`, in `demo`, and of `examples/hidden_delay.py`, in `hidden_delay`, are made first if they are
missing. docs/pictures/code.json keeps the hash of the code that drew each picture; a test compares it with today's.
Not drawn here: the actuator, whose data are not part of a clone.
"""

import contextlib
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

from PIL import Image

from tacdata.provenance import code_hash, content_hash, file_hash

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
CODE = PICTURES / "code.json"
TACDATA = Path(sys.executable).with_name("tacdata")
COLOURS = 128
"""Of a picture of a page: a fraction of the bytes."""
PACKAGES = {
    "episode.png": ("tacdata.viewers.pictures",),
    "press.gif": ("tacdata.viewers.pictures",),
    "verdict.png": ("tacdata.pages", "tacdata.discrepancy.page"),
    "browse.png": ("tacdata.pages",),
}
"""Picture -> the packages that draw it."""
OTHERS = tuple(
    f"tacdata.viewers.pictures.{name}"
    for name in ("hand_film", "replay_film", "replay_object", "felt_maps", "page_frames", "check", "plan", "tracks")
)
"""Modules of these packages that draw other pictures."""
FILES = {
    "verdict.png": ("tacdata/pages/style.css", "tacdata/pages/figures.js", "tacdata/pages/blocks.html.j2"),
    "browse.png": ("tacdata/pages/style.css", "viewers/browse/page.html"),
}
"""Picture -> the other files that draw it."""


def code_of(name):
    """Return the hash of the code that draws a picture; comments of Python files do not count."""
    return content_hash(
        [code_hash(*PACKAGES[name], without=OTHERS), *(file_hash(ROOT / file) for file in FILES.get(name, ()))]
    )


def demo():
    """Return the folder of a demo."""
    if not Path("demo/network/predictions").is_dir():
        subprocess.run([TACDATA, "demo"], check=True)
    return Path("demo")


def draw_pages():
    """Draw a press as a page and as a film."""
    subprocess.run([TACDATA, "pictures", demo(), "--out", PICTURES], check=True)


def draw_verdict():
    """Draw the upper part of a verdict's page."""
    page = Path("hidden_delay/verdict/verdict.html")
    if not page.is_file():
        subprocess.run([sys.executable, ROOT / "examples" / "hidden_delay.py", "--out", "hidden_delay"], check=True)
    photograph(page.resolve().as_uri(), "verdict.png", (1000, 1300), 1.0)


def draw_browse():
    """Draw the page of episodes with the worst one chosen."""
    folder = demo()
    words = [TACDATA, "browse", folder / "dataset", "--predictions", folder / "network", "--sort", "error", "--web"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as served:
        try:
            address = re.search(r"open (\S+)", served.stdout.readline())[1]
            photograph(address, "browse.png", (1400, 860), 25.0)
        finally:
            served.terminate()


def photograph(address, name, size, wait):
    """Write a picture of a page after some seconds."""
    from playwright import sync_api

    program = shutil.which("chromium") or shutil.which("chromium-browser")
    switches = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with (
        sync_api.sync_playwright() as playwright,
        contextlib.closing(playwright.chromium.launch(executable_path=program, args=switches)) as browser,
    ):
        page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        page.goto(address)
        page.wait_for_timeout(1000 * wait)
        page.screenshot(path=PICTURES / name)
    with Image.open(PICTURES / name) as picture:
        picture.convert("RGB").quantize(COLOURS).save(PICTURES / name, optimize=True)


DRAWN_BY = {"episode.png": draw_pages, "press.gif": draw_pages, "verdict.png": draw_verdict, "browse.png": draw_browse}


def main(names):
    """Draw the named pictures, or all."""
    names = names or list(DRAWN_BY)
    for draw in dict.fromkeys(DRAWN_BY[name] for name in names):
        draw()
    made = json.loads(CODE.read_text()) if CODE.is_file() else {}
    drawn = [name for name, draw in DRAWN_BY.items() if draw in {DRAWN_BY[n] for n in names}]
    CODE.write_text(json.dumps(made | {name: code_of(name) for name in drawn}, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
