"""CalculiX (Debian): the same mesh as C3D10, *HYPERELASTIC NEO HOOKE, rigid bodies as meshes, face-to-face penalty."""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from solvers import calculix_deck as deck
from solvers.peer import Answer, Peer, PeerError, outer_face, run_alone, within_reach

from tacdata.cases.case import Case
from tacdata.skin.mesh.skin_mesh import SkinMesh


@dataclass(frozen=True)
class CalculiX(Peer):
    """Debian's ccx."""

    name = "CalculiX"
    penalty: float = 200.0
    """Contact penalty [MPa/mm]; the slope while sticking is a tenth of it."""
    indenter_spacing: float = 0.35
    """Size of the indenter's quadratic facets [mm]."""
    limit: float = 3600.0
    """Longest run [s]."""

    def missing(self) -> str | None:
        """Return how to install it, if it is not there."""
        return None if shutil.which("ccx") else "apt-get install calculix-ccx (Debian, Ubuntu)"

    def solve(self, case: Case, mesh: SkinMesh, folder: Path) -> Answer:
        """Write the input, run ccx, read displacements and reactions."""
        if case.sensor.material.law != "neo_hookean":
            raise PeerError(f"law {case.sensor.material.law}: only neo_hookean is written for CalculiX")
        folder.mkdir(parents=True, exist_ok=True)
        if case.request.tilt_x or case.request.tilt_y or case.sensor.skin.curved:
            raise PeerError("tilted indenters and curved pads are not written in the deck (solvers/calculix_deck.py)")
        depths = [d for d in case.request.depths if d > 0]
        (folder / "press.inp").write_text("\n".join(self._deck(case, mesh, depths)) + "\n")
        (folder / "press.dat").unlink(missing_ok=True)
        run = run_alone([shutil.which("ccx") or "ccx", "press"], folder, self.limit)
        top, triangles = outer_face(mesh)
        tables = _tables((folder / "press.dat").read_text())
        if "*ERROR" in run.output or len(tables["displacements", "TOP"]) < len(depths):
            last = [line for line in run.output.splitlines() if "ERROR" in line][-1:]
            raise PeerError(f"CalculiX stopped after {len(tables['displacements', 'TOP'])} depths: {' '.join(last)}")
        moved = np.array([table[np.argsort(table[:, 0]), 1:] for table in tables["displacements", "TOP"]])
        plates = _plates(case, mesh)
        lift = np.array([[tables["forces", f"PLATE{t}"][k][0, -1] for t in plates] for k in range(len(depths))])
        force = np.array([table[0, -1] for table in tables["forces", "TIP"]])
        count, share = len(depths), 1 / len(depths)
        return Answer(
            np.array(depths),
            mesh.nodes[top, :2],
            triangles,
            moved,
            -force,
            lift.reshape(count, -1),
            np.full(count, np.nan),
            np.full(count, run.seconds * share),
            np.full(count, run.cpu_seconds * share),
            0.0,
            3 * int((~mesh.fixed(case.sensor.contact.bonded)).sum()),
            "time shared evenly among its depths",
        )

    def _deck(self, case: Case, mesh: SkinMesh, depths: list[float]) -> list[str]:
        material, friction = case.sensor.material, case.sensor.contact.friction
        lines = deck.skin(mesh)
        next_node, next_element = len(mesh.nodes) + 1, len(mesh.tets) + 1
        plates = {
            t: deck.board_plate(center, 0.9, -case.sensor.skin.protrusion_tip)
            for t, center in _plates(case, mesh).items()
        }
        bodies = {"TIP": deck.shell(deck.indenter_grid(case, self.indenter_spacing), 0.5)}
        bodies |= {f"PLATE{t}": deck.shell(plate, -0.5) for t, plate in plates.items()}
        for name, body in bodies.items():
            numbers = np.arange(next_node, next_node + len(body.nodes))
            lines += [*deck.nodes(numbers, body.nodes), *deck.node_set(f"N{name}", numbers)]
            lines += deck.hexahedra(name, next_element, next_node, body)
            next_node, next_element = next_node + len(body.nodes), next_element + len(body.hexahedra)
        lines += deck.faces("OUTER", mesh, mesh.outer[within_reach(case, mesh)])
        for t in plates:
            lines += deck.faces(f"BUMP{t}", mesh, mesh.protrusions[mesh.protrusion_taxel == t])
        held = np.flatnonzero(mesh.fixed(case.sensor.contact.bonded)) + 1
        lines += [*deck.node_set("HELD", held), *deck.node_set("NTOP", np.unique(mesh.outer) + 1)]
        lines += [
            "*MATERIAL,NAME=RUBBER",
            "*HYPERELASTIC,NEO HOOKE",
            f"{material.shear_modulus / 2!r},{2 / material.bulk_modulus!r}",
            "*MATERIAL,NAME=STEEL",
            "*ELASTIC",
            "1000.,0.3",
            *self._interaction("TOUCH", friction),
            "*CONTACT PAIR,INTERACTION=TOUCH,TYPE=SURFACE TO SURFACE",
            "OUTER,FTIP",
        ]
        if plates:
            lines += self._interaction("STAND", 0.0)
        for t in plates:
            lines += ["*CONTACT PAIR,INTERACTION=STAND,TYPE=SURFACE TO SURFACE", f"BUMP{t},FPLATE{t}"]
        lines += ["*BOUNDARY", "HELD,1,3"]
        for depth in depths:
            lines += ["*STEP,NLGEOM,INC=100", "*STATIC", "0.5,1.0,1e-4,1.0"]
            lines += ["*BOUNDARY", "NTIP,1,2,0.", f"NTIP,3,3,{-depth!r}"]
            lines += [f"NPLATE{t},1,3,0." for t in plates]
            lines += ["*NODE PRINT,NSET=NTOP,FREQUENCY=1000", "U"]
            lines += [
                line for name in bodies for line in (f"*NODE PRINT,NSET=N{name},TOTALS=ONLY,FREQUENCY=1000", "RF")
            ]
            lines.append("*END STEP")
        return lines

    def _interaction(self, name: str, friction: float) -> list[str]:
        lines = [f"*SURFACE INTERACTION,NAME={name}"]
        lines += ["*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=LINEAR", repr(self.penalty)]
        return [*lines, "*FRICTION", f"{friction!r},{self.penalty / 10!r}"] if friction else lines


def _plates(case: Case, mesh: SkinMesh) -> dict[int, np.ndarray]:
    """Return the centre of the board under each protrusion [mm], by taxel."""
    if not case.sensor.contact.board:
        return {}
    return {int(t): case.sensor.taxels.centers[t] for t in np.unique(mesh.protrusion_taxel)}


def _tables(text: str) -> dict[tuple[str, str], list[np.ndarray]]:
    """Return the tables of a .dat file: rows of numbers by quantity and set (without its N), one for each step."""
    found: dict[tuple[str, str], list[np.ndarray]] = {("displacements", "TOP"): []}
    title = re.compile(r"^\s*(?:total )?(\w+) .*for set N(\w+) and time", re.MULTILINE)
    heads = list(title.finditer(text))
    for head, after in zip(heads, [*heads[1:], None], strict=True):
        body = text[head.end() : after.start() if after else None].splitlines()[1:]
        rows = [[float(v) for v in line.split()] for line in body if line.strip()]
        quantity = "displacements" if head[1].startswith("displacement") else "forces"
        found.setdefault((quantity, head[2]), []).append(np.array(rows))
    return found
