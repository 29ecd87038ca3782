"""The table of machines that nobody here built: import, verdict, healthy reference, nulls.

    python run.py DATA OUT

DATA holds the folders friction_damper and linear_actuator as their authors publish them. OUT is filled; files that
exist are not made again. The table is printed as Markdown.
"""

import json
import subprocess
import sys
from pathlib import Path

import yaml

HERE = Path(__file__).resolve().parent
SETS = {
    "damper": ("friction_damper", HERE.parents[1] / "tacdata" / "example" / "damper.yaml"),
    "healthy": ("linear_actuator", "actuator_healthy.yaml"),
    "lubrication": ("linear_actuator", "actuator_lubrication.yaml"),
}


def tacdata(*words):
    """Run a verb."""
    subprocess.run([sys.executable, "-m", "tacdata.cli", *map(str, words)], check=True, stdout=subprocess.DEVNULL)


def halves(session, folder):
    """Copy a session's recordings into two folders: odd and even presses, and first and second half."""
    files = sorted(session.glob("*.mcap"))
    # Presses of three loads follow one another: each is split by itself.
    third = len(files) // 3
    parts = {
        "odd": files[0::2],
        "even": files[1::2],
        "first": [f for k in range(3) for f in files[k * third : k * third + third // 2]],
        "second": [f for k in range(3) for f in files[k * third + third // 2 : (k + 1) * third]],
    }
    for name, chosen in parts.items():
        (folder / name).mkdir(parents=True, exist_ok=True)
        for file in chosen:
            link = folder / name / file.name
            if not link.exists():
                link.hardlink_to(file)


def main(data, out):
    """Make the missing files, and print the table."""
    out.mkdir(exist_ok=True)
    for name, (source, mapping) in SETS.items():
        if not (out / name).exists():
            tacdata("import", data / source, "--mapping", HERE / mapping, "--out", out / name)
    halves(out / "healthy", out / "halves")
    comparisons = {
        "actuator, too little lubrication": ("lubrication", "healthy"),
        "null: even presses, healthy": ("halves/even", "halves/odd"),
        "null: second half, healthy": ("halves/second", "halves/first"),
    }
    expected = yaml.safe_load((HERE / "expected.yaml").read_text())
    print("| machine | compared with | status | sentence |\n|---|---|---|---|")
    for title, (measured, healthy) in comparisons.items():
        folder = out / f"difference-{measured.replace('/', '-')}"
        if not folder.exists():
            tacdata("discrepancy", out / measured, "--reference", out / healthy, "--out", folder)
        found = json.loads((folder / "difference.json").read_text())
        print(f"| {title} | {healthy} | {found['status']} | {found['sentence']} |")
    print("\n| machine | status | effects | expected |\n|---|---|---|---|")
    folder = out / "verdict-damper"
    if not folder.exists():
        tacdata("discrepancy", out / "damper", "--out", folder)
    verdict = json.loads((folder / "verdict.json").read_text())
    effects = "; ".join(f"{e['mechanism']} ({e['status']})" for e in verdict["effects"])
    print(f"| damper | {verdict['status']} | {effects} | {', '.join(expected['damper']['expected']['mechanisms'])} |")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
