"""The same mesh and the same law in another code: distance of its solution from ours.

    python benchmarks/same_mesh.py CASE [--peer getfem | calculix] [--out FOLDER] [--set step=0.1 ...]

CASE is a case file as for ``tacdata solve``. Prints a table; ``--set`` changes a setting of the other code
(`benchmarks/solvers/getfem.py`, `calculix.py`). Times are of one core; they are no fair race on a loaded machine.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np
from solvers.calculix import CalculiX
from solvers.differences import differences, grid, in_contact, reference_of
from solvers.getfem import GetFEM
from solvers.ours import Ours
from solvers.peer import Answer, Peer, PeerError

from tacdata.cases.case import Case, read_case
from tacdata.errors import TacdataError
from tacdata.skin.mesh.build import build_mesh
from tacdata.skin.mesh.skin_mesh import SkinMesh

PEERS = {"getfem": GetFEM, "calculix": CalculiX}


def compare(case: Case, mesh: SkinMesh, ours: Answer, theirs: Answer) -> list[dict]:
    """Return the rows of the table: our answer against theirs, with the cost of both."""
    request, skin = case.request, case.sensor.skin
    shape = (request.indenter, request.x, request.y, request.yaw)
    reference = reference_of(theirs, grid(skin.size_x, skin.size_y), lambda *given: in_contact(*shape, *given))
    rows = []
    for k, difference in enumerate(differences(ours, reference)):
        costs = {
            f"{who}_{name}": float(getattr(answer, name)[k])
            for who, answer in (("our", ours), ("their", theirs))
            for name in ("force", "residual", "seconds", "cpu_seconds")
        }
        rows.append({**asdict(difference), **costs, "our_dofs": ours.dofs, "their_dofs": theirs.dofs})
    return rows


def settings(peer: Peer, given: list[str]) -> Peer:
    """Return the peer with ``name=value`` settings applied."""
    kinds = {f.name: type(getattr(peer, f.name)) for f in fields(peer)}
    values = {}
    for pair in given:
        name, _, value = pair.partition("=")
        if name not in kinds:
            raise PeerError(f"no setting {name}; there are {', '.join(kinds)}")
        values[name] = kinds[name](value)
    return replace(peer, **values)


def main() -> None:
    """Solve with both and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", type=Path)
    parser.add_argument("--peer", choices=PEERS, default="getfem")
    parser.add_argument("--out", type=Path, help="keep the files of both here")
    parser.add_argument("--set", nargs="*", default=[], metavar="NAME=VALUE")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        out = (arguments.out or Path(scratch)).resolve()
        try:
            peer = settings(PEERS[arguments.peer](), arguments.set)
            if (how := peer.missing()) is not None:
                raise PeerError(f"{peer.name} is not here: {how}")
            case = read_case(arguments.case)
            mesh = build_mesh(case.sensor, case.settings.mesh)
            theirs, ours = peer.solve(case, mesh, out / arguments.peer), Ours().solve(case, mesh, out / "tacdata")
        except (PeerError, TacdataError) as error:
            parser.exit(1, f"{error}\n")
    rows = compare(case, mesh, ours, theirs)
    print(f"{case.name}: tacdata against {peer.name}, {len(mesh.nodes)} nodes, {len(mesh.tets)} elements")
    names = [name for name in rows[0] if not np.isnan([row[name] for row in rows]).all()]
    for name in names:
        print(f"{name:>18}", *(f"{row[name]:12.4g}" for row in rows))
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
