"""Files for a public host: they parse, agree with pyproject.toml, and name commands and paths that exist."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
FORMS = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("[!c]*.yml"))
DOCKERFILES = sorted((ROOT / "packaging" / "docker").glob("*.Dockerfile"))
CONDA_NAMES = {"matplotlib": "matplotlib-base", "opencv-contrib-python-headless": "py-opencv"}
"""Names on PyPI -> on conda-forge, where they differ."""
IN_THE_CLONE = re.compile(r"(?<![\w/])((?:\.ci|\.dev|packaging)/[\w./-]+)")


def document(path):
    return yaml.safe_load(path.read_text())


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_workflows_have_jobs_with_steps_and_least_rights(path):
    workflow = document(path)
    assert workflow["permissions"] == {"contents": "read"}
    for job in workflow["jobs"].values():
        assert "uses" in job or (job["runs-on"] and job["steps"])
        needs = job.get("needs", [])
        assert {*([needs] if isinstance(needs, str) else needs)} <= set(workflow["jobs"])
        for step in job.get("steps", []):
            assert len({"uses", "run"} & set(step)) == 1


def test_workflows_test_every_python_that_the_package_allows():
    matrix = document(ROOT / ".github" / "workflows" / "tests.yml")["jobs"]["suite"]["strategy"]["matrix"]
    assert PROJECT["requires-python"] == f">={matrix['python'][0]}"
    assert {name.split("-")[0] for name in matrix["os"]} == {"ubuntu", "macos"}


@pytest.mark.parametrize(
    "path", [*WORKFLOWS, *DOCKERFILES, ROOT / ".pre-commit-config.yaml"], ids=lambda path: path.name
)
def test_paths_are_there(path):
    assert not [name for name in IN_THE_CLONE.findall(path.read_text()) if not (ROOT / name).exists()]


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.stem)
def test_issue_forms_have_fields_with_labels(path):
    form = document(path)
    assert {"name", "description", "body"} <= set(form)
    identities = [field["id"] for field in form["body"]]
    assert len(set(identities)) == len(identities)
    for field in form["body"]:
        assert field["type"] in {"textarea", "input", "dropdown", "checkboxes"}
        assert field["attributes"]["label"]


def test_the_citation_has_the_required_keys_and_the_version():
    citation = document(ROOT / "CITATION.cff")
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert (citation["version"], citation["license"]) == (PROJECT["version"], PROJECT["license"])


def test_the_conda_recipe_has_the_dependencies_of_the_plain_install():
    recipe = document(ROOT / "packaging" / "conda" / "recipe.yaml")
    assert recipe["context"]["version"] == PROJECT["version"]
    wanted = set()
    for dependency in PROJECT["dependencies"]:
        name, versions = re.fullmatch(r"([\w-]+)(.*)", dependency).groups()
        wanted.add(f"{CONDA_NAMES.get(name, name)} {versions}".strip())
    assert {line for line in recipe["requirements"]["run"] if not line.startswith("python ")} == wanted


@pytest.mark.parametrize("path", DOCKERFILES, ids=lambda path: path.stem)
def test_dockerfiles_install_extras_that_exist_and_run_as_nobody_special(path):
    text = path.read_text()
    (extras,) = re.findall(r"'\.\[([\w,]+)\]'", text)
    assert set(extras.split(",")) <= set(PROJECT["optional-dependencies"])
    assert re.search(r"^USER (?!root)\w+$", text, re.MULTILINE)


def test_pre_commit_runs_the_checks_of_the_suite():
    hooks = document(ROOT / ".pre-commit-config.yaml")["repos"][0]["hooks"]
    suite = (ROOT / ".dev" / "suite.py").read_text()
    assert {hook["entry"].split()[0].rpartition("/")[2] for hook in hooks} == set(
        re.findall(r'BIN / "([\w-]+)"', suite)
    )
