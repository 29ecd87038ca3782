"""Run the notebooks and write their pages: `.venv/bin/python .dev/notebooks.py [NAME ...]`.

A notebook is a Python file in the percent format (`# %%` begins a cell), which editors and jupytext open as a notebook.
Its page in docs/notebooks has the code, the printed text and the pictures of one run.
"""

import ast
import contextlib
import io
import os
import re
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

os.environ["MPLBACKEND"] = "agg"
ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = ROOT / "examples" / "notebooks"
PAGES = ROOT / "docs" / "notebooks"
LONGEST = 60
"""Printed lines of a cell on the page."""
DPI = 80
COLOURS = 64
"""Of a picture: a fraction of the bytes."""


def cells(source):
    """Return (kind, text) of each cell; kind is "markdown" or "code"."""
    found = []
    for part in re.split(r"^# %%", source, flags=re.MULTILINE)[1:]:
        head, _, body = part.partition("\n")
        if "[markdown]" in head:
            found.append(("markdown", "\n".join(line.removeprefix("#").removeprefix(" ") for line in body.split("\n"))))
        else:
            found.append(("code", body))
    return [(kind, text.strip()) for kind, text in found]


def run(name, folder):
    """Run a notebook in an empty folder.

    Returns:
        For each cell its kind, text and outputs (a string, or a figure), and the names that the cells bound.
    """
    shared, results = {"__name__": "__main__"}, []
    with contextlib.chdir(folder):
        for kind, text in cells((NOTEBOOKS / f"{name}.py").read_text()):
            results.append((kind, text, _outputs(text, name, shared) if kind == "code" else []))
    return results, shared


def _outputs(text, name, shared):
    tree, value, printed = ast.parse(text), None, io.StringIO()
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, name, "exec"), shared)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), name, "eval"), shared)
    outputs = [printed.getvalue()] if printed.getvalue().strip() else []
    if value is not None and not (isinstance(last.value, ast.Call) and isinstance(value, int)):
        outputs.append(value if hasattr(value, "savefig") else repr(value))
    return outputs


def page(name, results, seconds):
    """Return the page, and write its pictures."""
    parts = []
    for kind, text, outputs in results:
        parts.append(text if kind == "markdown" else f"```python\n{text}\n```")
        for output in outputs:
            parts.append(_picture(name, len(parts), output) if hasattr(output, "savefig") else _printed(output))
    parts.append(
        f"*Notebook: `examples/notebooks/{name}.py`. This run took {seconds:.0f} s of the processor; "
        "`.dev/notebooks.py` repeats it.*"
    )
    return "\n\n".join(parts) + "\n"


def _picture(name, number, figure):
    place = PAGES / "pictures" / f"{name}-{number}.png"
    figure.savefig(place, dpi=DPI, bbox_inches="tight")
    with Image.open(place) as picture:
        picture.convert("RGB").quantize(COLOURS).save(place, optimize=True)
    return f"![picture {number} of the notebook](pictures/{place.name})"


def _printed(text):
    lines = text.rstrip().split("\n")
    shown = lines if len(lines) <= LONGEST else [*lines[:LONGEST], "…"]
    return "```text\n" + "\n".join(shown) + "\n```"


def code_of(text):
    """Return the Python blocks of a page, one string a cell."""
    return [body.strip() for body in re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)]


def main(names):
    """Write the pages of the notebooks named, or of all."""
    for name in names or sorted(path.stem for path in NOTEBOOKS.glob("*.py")):
        for old in (PAGES / "pictures").glob(f"{name}-*.png"):
            old.unlink()
        begin = sum(os.times()[:4])
        with tempfile.TemporaryDirectory() as folder:
            results, _ = run(name, folder)
        (PAGES / f"{name}.md").write_text(page(name, results, sum(os.times()[:4]) - begin))
        print(f"docs/notebooks/{name}.md {time.strftime('%H:%M:%S')}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
