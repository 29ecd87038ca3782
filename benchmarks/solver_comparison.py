"""The same presses on codes that a user would pick instead: time per equilibrium and error, side by side, in one run.

    python benchmarks/solver_comparison.py --out FOLDER [--reference FOLDER] [--peers FOLDER --install]
        [--only tacdata,getfem] [--slab-depths 0.25 0.5] [--sensor-depths 0.25] [--coarse]

Two presses of a sphere of 4 mm radius: on a plain slab of 16 x 12 x 4 mm (its bottom bonded), and on the default sensor
above a protrusion (its sides bonded, a frictionless board below). Codes: tacdata, GetFEM and CalculiX on one mesh of
quadratic tetrahedra; Newton's VBD and MuJoCo's flex on grids of their own (slab only). One thread each.

Errors are against the solutions in ``--reference`` (NAME.parquet: depth, x, y, ux, uy, uz; NAME.json: results with
depth, force_N, floor_forces_N), NAME being A1 and B2; without them against the answer on a finer mesh of GetFEM, or of
tacdata where GetFEM is missing. Writes comparison.md, comparison.json and comparison.png.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from solvers.calculix import CalculiX
from solvers.differences import Reference, differences, grid, in_contact, reference_from_table, reference_of
from solvers.environment import install
from solvers.getfem import GetFEM
from solvers.mujoco_flex import MuJoCoFlex
from solvers.newton_vbd import NewtonVBD
from solvers.ours import Ours
from solvers.peer import Answer, Peer, PeerError

from tacdata import documents
from tacdata.cases.case import Case, read_case
from tacdata.errors import TacdataError
from tacdata.sensor import default_sensor
from tacdata.skin.mesh.build import build_mesh

SPHERE = {"shape": "sphere", "radius": 4.0}
SLAB = {"size_x": 16.0, "size_y": 12.0, "thickness": 4.0, "protrusion_radius": 0.0}
ROUGH = {"outer": 1.1, "interior": 2.8, "protrusion": 1.6, "tip": 0.28}
"""A mesh of ours that errs about as much as others do on one of 0.8 mm [mm]."""
FINE = {"outer": 0.45, "interior": 1.2, "protrusion": 0.8}


@dataclass(frozen=True)
class Entry:
    """A code with its settings, on one of the presses."""

    label: str
    """Shown in the table."""
    peer: Peer
    """The code."""
    mesh: dict[str, float]
    """Mesh settings of the case file, for the codes that take our mesh."""


def case_document(name: str, depths: list[float], mesh: dict[str, float]) -> dict:
    """Return the case file of the slab ("slab") or of the sensor ("sensor")."""
    sensor = json.loads(json.dumps(default_sensor().document))
    if name == "slab":
        sensor["skin"], sensor["contact"] = SLAB, {"friction": 0.0, "bonded": ["bottom"], "board": False}
        place = {"x": 0.0, "y": 0.0}
    else:
        sensor["contact"] = {"friction": 0.0, "bonded": ["sides"], "board": True}
        place = {"x": 0.95, "y": 1.25}
    sensor["name"] = name
    document = {"version": "1.0", "name": name, "sensor": sensor, "indenter": SPHERE, **place}
    return {**document, "depths": depths, "mesh": mesh}


def entries(name: str, arguments: argparse.Namespace) -> list[Entry]:
    """Return the entries to run on a press, cheapest codes first."""
    peers, coarse = arguments.peers, {"outer": 0.8}
    found = [Entry("tacdata, 1.1 mm", Ours(), ROUGH), Entry("tacdata, 0.8 mm", Ours(), coarse)]
    if not arguments.coarse:
        found.append(Entry("tacdata, default mesh", Ours(), {}))
    if name == "slab":
        grids = (1.0,) if arguments.coarse else (1.0, 0.5)
        sweeps = {1.0: 20, 0.5: 40}
        found += [Entry(f"Newton VBD, {h:g} mm", NewtonVBD(peers, h, iterations=sweeps[h]), coarse) for h in grids]
        found += [Entry(f"MuJoCo flex, {h:g} mm", MuJoCoFlex(peers, h), coarse) for h in grids]
    found += [Entry("GetFEM, 0.8 mm", GetFEM(), coarse), Entry("CalculiX, 0.8 mm", CalculiX(), coarse)]
    only = arguments.only.lower().split(",") if arguments.only else None
    return [e for e in found if only is None or any(e.label.lower().startswith(o) for o in only)]


def contact_of(case: Case):
    """Return the test of contact, for `differences`."""
    request = case.request
    return lambda *given: in_contact(request.indenter, request.x, request.y, request.yaw, *given)


def reference(name: str, case: Case, arguments: argparse.Namespace, scratch: Path) -> tuple[Reference, str]:
    """Return the reference of the errors, and its name."""
    points = grid(case.sensor.skin.size_x, case.sensor.skin.size_y)
    stored = {"slab": "A1", "sensor": "B2"}[name]
    if arguments.reference and (arguments.reference / f"{stored}.parquet").exists():
        table = pq.read_table(arguments.reference / f"{stored}.parquet").to_pydict()
        table = {k: np.array(v) for k, v in table.items() if k != "case"}
        results = json.loads((arguments.reference / f"{stored}.json").read_text())["results"]
        order = [f"{k % 6},{k // 6}" for k in range(24)]
        force = {round(r["depth"], 6): r["force_N"] for r in results}
        lift = {
            round(r["depth"], 6): np.array([r["floor_forces_N"][k] for k in order] if "floor_forces_N" in r else [])
            for r in results
        }
        return reference_from_table(table, force, lift, points, contact_of(case)), f"the stored solution {stored}"
    document = {**case.document, "mesh": FINE}
    fine = write_case(document, scratch)
    mesh = build_mesh(fine.sensor, fine.settings.mesh)
    peer = Ours() if GetFEM().missing() else GetFEM()
    answer = peer.solve(fine, mesh, scratch / "reference")
    return reference_of(answer, points, contact_of(case)), f"{peer.name} on a finer mesh ({len(mesh.nodes)} nodes)"


def write_case(document: dict, folder: Path) -> Case:
    """Write a case file and read it as everybody does."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "case.json"
    documents.write(path, document, "case")
    return read_case(path)


def penetration(case: Case, answer: Answer) -> np.ndarray:
    """Return how deep a node of the outer face lies inside the sphere at most, in % of each depth, shape (d,)."""
    flat = np.full(len(answer.places), case.sensor.skin.thickness)
    nodes = np.column_stack([answer.places, flat]) + answer.displacement
    centers = np.array([[case.request.x, case.request.y, flat[0] + SPHERE["radius"] - d] for d in answer.depth])
    inside = SPHERE["radius"] - np.linalg.norm(nodes - centers[:, None], axis=2)
    return 100 * inside.max(axis=1).clip(0.0) / answer.depth


def rows_of(name: str, entry: Entry, case: Case, answer: Answer, against: Reference) -> list[dict]:
    """Return one row for each depth."""
    deep = penetration(case, answer)
    return [
        {
            "press": name,
            "code": entry.label,
            **asdict(d),
            "penetration": float(deep[k]),
            "seconds": float(answer.seconds[k]),
            "cpu_seconds": float(answer.cpu_seconds[k]),
            "setup_cpu_seconds": answer.setup_cpu_seconds,
            "dofs": answer.dofs,
            "residual": float(answer.residual[k]),
            "note": answer.note,
        }
        for d in differences(answer, against)
        for k in [int(np.abs(answer.depth - d.depth).argmin())]
    ]


def speed_and_error(rows: list[dict]) -> list[str]:
    """Return one table of all codes: CPU time of an equilibrium, and the worst figures but at the first depth."""
    measures = ("residual", "penetration", "force", "top", "contact", "protrusion")
    titles = ["press", "code", "CPU s", measures[0], *(f"{measure} %" for measure in measures[1:])]
    lines = [f"| {' | '.join(titles)} |", "|---" * len(titles) + "|"]
    for press, code in dict.fromkeys((r["press"], r["code"]) for r in rows):
        own = [r for r in rows if (r["press"], r["code"]) == (press, code)]
        later = own[1:] or own
        seconds = sorted(r["cpu_seconds"] for r in own)
        worst = [max(abs(r[name]) for r in later) for name in measures]
        figures = ["" if np.isnan(value) else f"{value:.2g}" for value in worst]
        lines.append(f"| {press} | {code} | {seconds[0]:.2g} to {seconds[-1]:.2g} | {' | '.join(figures)} |")
    return lines


def table(rows: list[dict], absent: list[tuple[str, str, str]], against: dict[str, str]) -> str:
    """Return the report in Markdown."""
    load = ", ".join(f"{v:.1f}" for v in os.getloadavg())
    lines = [
        "# Solver comparison",
        "",
        f"{platform.machine()}, {os.cpu_count()} cores, load average {load} at the end, Python "
        f"{platform.python_version()}; one thread a code.",
        "CPU seconds and wall seconds are those of one equilibrium, from the depth before; setup comes once a press.",
        "Errors: force; root of the mean square of the depth field over the outer face, inside the contact; largest;",
        "protrusions in % of the largest. Linear elements are compared at their vertices, in their favour.",
        "",
        *speed_and_error(rows),
        "",
    ]
    for name, what in against.items():
        lines += [
            f"## {name}: sphere of 4 mm radius, errors against {what}",
            "",
            "| code | unknowns | depth mm | CPU s | wall s | setup CPU s | force % | top % | contact % | largest % | "
            "protrusion % | note |",
            "|---|---|---|---|---|---|---|---|---|---|---|---|",
        ]
        for r in (r for r in rows if r["press"] == name):
            figures = [f"{r[k]:.3g}" for k in ("depth", "cpu_seconds", "seconds", "setup_cpu_seconds")]
            figures += [f"{r['force']:+.2f}"] + [f"{r[k]:.2f}" for k in ("top", "contact", "largest")]
            figures.append("" if np.isnan(r["protrusion"]) else f"{r['protrusion']:.1f}")
            lines.append(f"| {r['code']} | {r['dofs']} | {' | '.join(figures)} | {r['note']} |")
        lines += ["", *(f"- {label}: {why}" for press, label, why in absent if press == name), ""]
    return "\n".join(lines)


def draw(rows: list[dict], path: Path) -> None:
    """Draw error over CPU seconds, one line a code through its depths."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullFormatter

    presses = sorted({r["press"] for r in rows}, reverse=True)
    measures = (("force", "force error [%]"), ("top", "depth field, rms [% of depth]"))
    figure, axes = plt.subplots(len(presses), 2, figsize=(11, 4.5 * len(presses)), squeeze=False, layout="constrained")
    codes = list(dict.fromkeys(r["code"] for r in rows))
    for row, press in zip(axes, presses, strict=True):
        for axis, (measure, label) in zip(row, measures, strict=True):
            for k, code in enumerate(codes):
                own = [r for r in rows if r["press"] == press and r["code"] == code]
                x, y = [r["cpu_seconds"] for r in own], [abs(r[measure]) for r in own]
                axis.loglog(x, y, "o-", color=f"C{k}", label=code if own else None, linewidth=1)
                for r, a, b in zip(own, x, y, strict=True):
                    axis.annotate(f"{r['depth']:g}", (a, b), fontsize=7, xytext=(3, 3), textcoords="offset points")
            axis.set(title=press, xlabel="CPU seconds per equilibrium", ylabel=label)
            axis.margins(0.15)
            axis.grid(alpha=0.3, which="both")
            for one, low, high in ((axis.xaxis, *axis.get_xlim()), (axis.yaxis, *axis.get_ylim())):
                one.set_major_formatter("{x:g}")
                one.set_minor_formatter("{x:g}" if high < 10 * low else NullFormatter())
        row[0].legend(fontsize=8)
    figure.savefig(path, dpi=110)


def run_press(name: str, depths: list[float], arguments: argparse.Namespace, absent: list) -> tuple[list[dict], str]:
    """Run everything on one press; a code that cannot run goes into ``absent`` with the reason."""
    scratch = arguments.out / name
    first = write_case(case_document(name, depths, {"outer": 0.8}), scratch)
    against, what = reference(name, first, arguments, scratch / "reference")
    rows = []
    for entry in entries(name, arguments):
        folder = scratch / entry.label.replace(" ", "_").replace(",", "")
        how = entry.peer.missing()
        if how is not None:
            absent.append((name, entry.label, f"missing: {how}"))
            continue
        case = write_case(case_document(name, depths, entry.mesh), folder)
        try:
            mesh = build_mesh(case.sensor, case.settings.mesh)
            if isinstance(entry.peer, Ours | NewtonVBD):  # kernels are compiled once a machine: not a cost of a press
                shallow = write_case({**case.document, "depths": [0.05]}, folder / "first")
                entry.peer.solve(shallow, mesh, folder / "first")
            answer = entry.peer.solve(case, mesh, folder)
        except (PeerError, TacdataError) as error:
            absent.append((name, entry.label, str(error)))
            continue
        rows += rows_of(name, entry, case, answer, against)
        print(f"{name}: {entry.label}: {', '.join(f'{s:.2f}' for s in answer.cpu_seconds)} CPU s", flush=True)
    return rows, what


def main() -> None:
    """Run the comparison."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--reference", type=Path)
    parser.add_argument("--peers", type=Path, default=Path.home() / ".cache" / "tacdata" / "peers")
    parser.add_argument("--install", action="store_true", help="make the environments of the peers from PyPI")
    parser.add_argument("--only", help="codes to run, by the beginnings of their names")
    parser.add_argument("--coarse", action="store_true", help="only the coarser of two settings")
    parser.add_argument("--slab-depths", type=float, nargs="*", default=[0.25, 0.5, 0.75, 1.0])
    parser.add_argument("--sensor-depths", type=float, nargs="*", default=[0.25, 0.5, 0.75])
    arguments = parser.parse_args()
    arguments.out, arguments.peers = arguments.out.resolve(), arguments.peers.expanduser().resolve()
    for peer in (NewtonVBD(arguments.peers), MuJoCoFlex(arguments.peers)):
        if arguments.install and peer.missing() and (wrong := install(arguments.peers, peer.module, peer.requirement)):
            print(f"{peer.name} could not be installed: {wrong}")
    rows, absent, against = [], [], {}
    for name, depths in (("slab", arguments.slab_depths), ("sensor", arguments.sensor_depths)):
        if depths:
            found, against[name] = run_press(name, depths, arguments, absent)
            rows += found
    report = table(rows, absent, against)
    (arguments.out / "comparison.md").write_text(report + "\n")
    document = {"rows": rows, "absent": absent, "against": against, "load": os.getloadavg()}
    (arguments.out / "comparison.json").write_text(json.dumps(document, indent=1) + "\n")
    if rows:
        draw(rows, arguments.out / "comparison.png")
    print(report)


if __name__ == "__main__":
    main()
