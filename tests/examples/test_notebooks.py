"""Notebooks run from beginning to end, and their pages show the code of today."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NAMES = sorted(path.stem for path in (ROOT / "examples" / "notebooks").glob("*.py"))


@pytest.fixture(scope="module")
def notebooks():
    spec = importlib.util.spec_from_file_location("notebooks", ROOT / ".dev" / "notebooks.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", NAMES)
def test_the_page_shows_the_code_of_today(notebooks, name):
    code = [text for kind, text in notebooks.cells((notebooks.NOTEBOOKS / f"{name}.py").read_text()) if kind == "code"]
    text = (notebooks.PAGES / f"{name}.md").read_text()
    assert notebooks.code_of(text) == code, f"run .dev/notebooks.py {name}"
    assert f"pictures/{name}-" in text, "a notebook shows a picture"


def test_notebooks_use_public_names_alone(notebooks):
    for name in NAMES:
        imports = [line for line in (notebooks.NOTEBOOKS / f"{name}.py").read_text().splitlines() if "tacdata" in line]
        assert not [line for line in imports if line.startswith(("from tacdata", "import tacdata."))], name


CHECKS = {
    "a_verdict": lambda names: names["verdict"].status == "named",
    "import_a_csv": lambda names: len(names["session"]) == 4,
    "look_at_a_session": lambda names: names["peak"].argmax() == 19,
    "simulate_and_pretrain": lambda names: names["simulated"].episodes == 4,
    # Neo-Hookean silicone under a ball of 4 mm, 0.8 mm deep: 0.65 N.
    "solve_a_press": lambda names: 0.6 < abs(names["solution"].force[names["deepest"], 2]) < 0.7,
    "train_on_eight_presses": lambda names: abs(names["prediction"].depth.max() - names["peak"]) < 0.3,
}
"""Notebook -> whether its result is right, by the names that its cells bind."""


@pytest.mark.long("tacdata", "training", "label_farm", "viewers", reason="a notebook may take two minutes")
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_runs(notebooks, name, tmp_path):
    results, names = notebooks.run(name, tmp_path)
    assert sum(hasattr(output, "savefig") for _, _, outputs in results for output in outputs) >= 1
    assert CHECKS[name](names)
