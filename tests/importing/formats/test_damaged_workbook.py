"""A workbook with a damaged part, read by a process of its own: it must end in words, not in a crash as it ends."""

import subprocess
import sys
from zipfile import ZipFile

import numpy as np
import pytest
from openpyxl import Workbook

DAMAGE = {
    "cut off": lambda text: text[: len(text) // 2],
    "another tag": lambda text: text[: len(text) // 2] + text[len(text) // 2 :].replace(b"</", b"</x", 1),
    "no end tags": lambda text: text.replace(b"</", b"<", 20),
}


@pytest.mark.parametrize("part", ["xl/worksheets/sheet1.xml", "xl/workbook.xml", "xl/styles.xml"])
@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_part_ends_in_words_and_an_exit_status(tmp_path, part, damage):
    book = Workbook()
    for row in [["t [s]", "depth [mm]", "cap0"], *np.random.default_rng(0).normal(size=(200, 3)).tolist()]:
        book.active.append(row)
    book.save(tmp_path / "whole.xlsx")
    with ZipFile(tmp_path / "whole.xlsx") as whole, ZipFile(tmp_path / "damaged.xlsx", "w") as damaged:
        for name in whole.namelist():
            text = whole.read(name)
            damaged.writestr(name, DAMAGE[damage](text) if name == part else text)
    command = [sys.executable, "-m", "tacdata.cli", "import", "damaged.xlsx"]
    made = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert made.returncode == 3, made.stderr
    assert "damaged.xlsx cannot be read as xlsx" in made.stderr and "copy or save it again" in made.stderr
