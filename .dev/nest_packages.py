"""Codemod: schemas, label_farm, training and viewers become tacdata.schemas, ... ; the folders stay where they are.

Run at the root of a clean clone, with its .venv/bin/python: `.venv/bin/python /work/bin/nest_packages.py`. It can be run
again on any later state of main; it edits imports, module names in strings, contracts, and makes the four links in tacdata/.
"""
import ast, os, re, subprocess, sys
from pathlib import Path
P = ("schemas", "label_farm", "training", "viewers")
ROOT = Path.cwd()
tracked = subprocess.run(["git", "ls-files", "-z"], capture_output=True, text=True, check=True).stdout.split("\0")
files = [Path(f) for f in tracked if f and not Path(f).is_symlink()]
alt = "|".join(P)
# module names in strings: dotted names that exist as a module or package
def exists(dotted):
    path = ROOT.joinpath(*dotted.split("."))
    return path.is_dir() or path.with_suffix(".py").is_file()
MADE_BY = re.compile(r"stamp\(\s*$|made_by")
def strings(text, own=None):
    def repl(m):
        head, name = m[1], m[2]
        parts = name.split(".")
        while parts and not exists(".".join(parts)):
            parts = parts[:-1]
        if len(parts) < 2 and "." in name:
            return m[0]
        return f"{head}tacdata.{name}"
    # quoted dotted names, not file names
    text = re.sub(rf"""((?:\bf|\b)?["'])((?:{alt})\.(?!schema\b|npz|md|yaml|json|py\b)[A-Za-z_{{][\w.{{}}*]*)""", repl, text)
    return text
def python(path):
    text = path.read_text(encoding="utf-8")
    lines = text.split("\n")
    try:
        tree = ast.parse(text)
    except SyntaxError:
        return text
    whole = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module and node.module.split(".")[0] in P:
            i = node.lineno - 1
            lines[i] = re.sub(rf"\bfrom ({alt})\b", r"from tacdata.\1", lines[i], count=1)
        elif isinstance(node, ast.Import):
            for a in node.names:
                top = a.name.split(".")[0]
                if top in P:
                    i = node.lineno - 1
                    if a.name == top and not a.asname:
                        lines[i] = re.sub(rf"\bimport {top}\b", f"from tacdata import {top}", lines[i])
                    else:
                        lines[i] = re.sub(rf"\bimport {re.escape(a.name)}\b", f"import tacdata.{a.name}", lines[i])
                        if not a.asname:
                            whole.add(a.name)
    text = "\n".join(lines)
    for name in whole:  # names used as dotted paths in code
        text = re.sub(rf"(?<![\w.\"'/])(?<!import ){re.escape(name)}(?=\.)", f"tacdata.{name}", text)
    # doctests and code in strings
    text = re.sub(rf"^(\s*(?:>>> |\.\.\. )?)from ({alt})(?=[. ])", r"\1from tacdata.\2", text, flags=re.M)
    text = re.sub(rf"(?<=[\"'\n;] )from ({alt})(?=\.)", r"from tacdata.\1", text)
    text = re.sub(rf"([\"';] ?)from ({alt})(?=\.)", r"\1from tacdata.\2", text)
    return text
PROVENANCE = {"training.scoring.evaluate", "training.train", "training.scoring.protocols", "training.metrics.conformal_intervals", "training.metrics.novelty", "training.pretraining.learning_curve"}
def no_stamp(text):
    """Names written into documents stay: they are data."""
    for name in PROVENANCE:
        text = re.sub(rf'"tacdata\.{re.escape(name)}"(?=[,)])', f'"{name}"', text)
    return text
changed = 0
for f in files:
    if f.suffix == ".py" and not f.name.endswith("_pb2.py"):
        old = f.read_text(encoding="utf-8")
        new = python(f)
        if f.parts[0] not in ("docs",):
            new = strings(new)
            if f.parts[0] in P:
                new = no_stamp(new)
        if new != old:
            f.write_text(new, encoding="utf-8"); changed += 1
    elif f.suffix == ".md":
        old = f.read_text(encoding="utf-8")
        new = re.sub(rf"^(\s*(?:>>> |\.\.\. )?)from ({alt})(?=[. ])", r"\1from tacdata.\2", old, flags=re.M)
        new = re.sub(rf"python -m ({alt})\.", r"python -m tacdata.\1.", new)
        if new != old:
            f.write_text(new, encoding="utf-8"); changed += 1
for p in P:
    link = ROOT / "tacdata" / p
    if not link.is_symlink():
        link.symlink_to(Path("..") / p)
# contracts
s = (ROOT / ".importlinter").read_text()
s = s.replace("root_packages =\n    tacdata\n    label_farm\n    training\n    viewers\n    schemas\n", "root_packages =\n    tacdata\n")
s = re.sub(rf"(?<![\w.])({alt})(?=$|\.|\s*\||\s*->)", r"tacdata.\1", s, flags=re.M)
s = re.sub(rf"(\| |-> )({alt})\b", r"\1tacdata.\2", s)
s = s.replace("name = Imports go one way: verbs, tacdata.viewers", "name = Imports go one way: verbs, viewers")
(ROOT / ".importlinter").write_text(s)
s = (ROOT / "pyproject.toml").read_text()
s = s.replace('packages = ["tacdata", "schemas", "label_farm", "training", "viewers"]', 'packages = ["tacdata"]  # links in it bring schemas, label_farm, training and viewers')
s = s.replace('include = ["tacdata", "schemas", "label_farm", "training", "viewers"]', 'include = ["tacdata"]')
(ROOT / "pyproject.toml").write_text(s)
print(changed, "files changed")

# --- places that join folder names and module names -------------------------------------------------------------------
def sub(p, *pairs):
    path = ROOT / p
    s = path.read_text(encoding="utf-8")
    for a, b in pairs:
        if a not in s:
            if b not in s:
                print(f"LOOK: {p}: not found: {a[:70]!r}")
            continue
        s = s.replace(a, b)
    path.write_text(s, encoding="utf-8")
sub("tacdata/catalogue.py", ('PACKAGES = ("tacdata", "label_farm", "training", "viewers")', 'PACKAGES = ("tacdata", "tacdata.label_farm", "tacdata.training", "tacdata.viewers")'))
sub("tacdata/extras.py", ('"training": "learn", "viewers": "view"', '"tacdata.training": "learn", "tacdata.viewers": "view"'))
sub("training/reports/html_page.py", ('PackageLoader("training", "reports")', 'PackageLoader("tacdata.training", "reports")'))
sub("tacdata/provenance.py", ('''    if not isinstance(node, ast.AST):
        return node
''', '''    if isinstance(node, str):
        # Their versions are those of releases that had these packages beside tacdata.
        return re.sub(r"\\btacdata\\.(?=(?:schemas|label_farm|training|viewers)\\b)", "", node)
    if not isinstance(node, ast.AST):
        return node
'''), ("import json\nimport subprocess", "import json\nimport re\nimport subprocess"))
s = (ROOT / ".importlinter").read_text()
s = s.replace("    tacdata.commands.** -> tacdata.viewers.**\n", "    tacdata.viewers.** -> rerun\n    tacdata.viewers.** -> rerun.**\n")
s = s.replace("floor, tacdata.schemas", "floor, schemas").replace("elements nor tacdata.viewers", "elements nor viewers")
s = re.sub(r"(name = Only viewers draw in Rerun\ntype = forbidden\nsource_modules =\n    tacdata\n)(?:    tacdata\.\w+\n)+", r"\1", s)
s = re.sub(r"(type = acyclic_siblings\nancestors =\n    tacdata\n)(?:    tacdata\.\w+\n)+", r"\1", s)
# every room of tacdata has a place: the packages too
s = s.replace("    revision\n    pipeline\n    exporters", "    revision\n    pipeline\n    viewers\n    training | label_farm\n    exporters").replace("    errors | paths\nexhaustive", "    errors | paths\n    schemas\nexhaustive")
(ROOT / ".importlinter").write_text(s)
sub("tests/architecture/test_extras.py", ('    "training": "learn",', '    "tacdata.training": "learn",'), ('OWN = ("tacdata", "schemas", "label_farm", "training", "viewers")', 'OWN = ("tacdata",)'))
sub("tests/architecture/test_wheel.py", ("        p.relative_to(ROOT).as_posix()\n", '        ("" if package == "tacdata" else "tacdata/") + p.relative_to(ROOT).as_posix()\n'),
    ('{"schemas/sensor.schema.json", "tacdata/sensor/tacprint.yaml", "viewers/__init__.py"}', '{"tacdata/schemas/sensor.schema.json", "tacdata/sensor/tacprint.yaml", "tacdata/viewers/source.py"}'),
    ('if ".dist-info/" not in n} == set(PACKAGES)', 'if ".dist-info/" not in n} == {"tacdata"}'))
sub("tests/docs/test_docstring_examples.py", ('''    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
''', '''    name = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    return name if name.startswith("tacdata") else f"tacdata.{name}"
'''))
sub("tests/architecture/test_class_names.py", ('        folder = ROOT / each.room.replace(".", "/")\n', '        folder = (ROOT / each.room.replace(".", "/")).resolve()\n'))
sub("tests/architecture/test_rooms.py", ('            found[room.replace(".", "/")] |= set(registry.names(room, base))', '            found[name((ROOT / room.replace(".", "/")).resolve())] |= set(registry.names(room, base))'))
sub("tests/running/long_part.py", ('''    if words[0] not in PACKAGES:
        return None
    if words[0] != "tacdata":
        return words[0]
''', '''    if words[0] != "tacdata":
        return None
    if words[1:2] and words[1] in PACKAGES:
        return words[1]
'''))
sub("tests/docs/test_architecture.py", ('[module.strip().replace(".", "/") for module in line.split("|")]', '[_folder(module.strip()) for module in line.split("|")]'),
    ("def layers():", '''def _folder(module):
    """Return a room's folder: four packages of tacdata are at the top of the clone."""
    path = module.replace(".", "/")
    return path.removeprefix("tacdata/") if (ROOT / path).is_symlink() else path


def layers():'''),
    ('    assert ROOMS[room] == sorted(path.parent.name for path in (ROOT / room).glob("*/__init__.py"))', '    folders = (path.parent for path in (ROOT / room).glob("*/__init__.py"))\n    assert ROOMS[room] == sorted(folder.name for folder in folders if not folder.is_symlink())'))
sub("label_farm/simulated/crew.py", ('            [*environment.python("tacdata.label_farm.simulated.worker"), str(folder), str(presses), str(index), str(of)],', '            [*environment.python("tacdata.label_farm.simulated.worker"), str(folder), *map(str, (presses, index, of))],'))
s = (ROOT / "pyproject.toml").read_text()
if "banned-api" not in s:
    s = s.replace('"TID253"]\nignore', '"TID251", "TID253"]\nignore')
    s = s.replace("[tool.ruff.lint.per-file-ignores]", "[tool.ruff.lint.flake8-tidy-imports.banned-api]\n" + "".join(f'{p}.msg = "import tacdata.{p}"\n' for p in P) + "\n[tool.ruff.lint.per-file-ignores]", 1)
(ROOT / "pyproject.toml").write_text(s)
