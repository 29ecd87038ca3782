"""tacdata's own skin model, through the same case file that anyone else would write."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from solvers.peer import ALONE, Answer, Peer, PeerError, main_interpreter, outer_face, run_alone

from tacdata import documents
from tacdata.cases.case import Case
from tacdata.skin.mesh.skin_mesh import SkinMesh


@dataclass(frozen=True)
class Ours(Peer):
    """The model of ``tacdata solve``."""

    name = "tacdata"
    limit: float = 3600.0
    """Longest run [s]."""

    def missing(self) -> str | None:
        """Return None: it is always there."""
        return None

    def solve(self, case: Case, mesh: SkinMesh, folder: Path) -> Answer:
        """Solve the case from depth 0 on; the state at 0 holds the cost of the start."""
        depths = [d for d in case.request.depths if d > 0]
        folder.mkdir(parents=True, exist_ok=True)
        for stale in ("press.json", "press.parquet"):
            (folder / stale).unlink(missing_ok=True)
        file = folder / "case.json"
        document = {**case.document, "name": "press", "depths": [0.0, *depths], "sensor": case.sensor.document}
        document["error_estimate"] = False
        documents.write(file, document, "case")
        run_alone([main_interpreter(), str(ALONE / "ours_press.py"), str(file), str(folder)], folder, self.limit)
        report = documents.read(folder / "press.json", "case_result")
        results = report["results"][1:]
        times = np.array(json.loads((folder / "times.json").read_text()))
        top, triangles = outer_face(mesh)
        places = mesh.nodes[top, :2]
        return Answer(
            np.array(depths),
            places,
            triangles,
            _displacements(folder / "press.parquet", depths, places),
            np.array([r["force_N"][2] for r in results]),
            _protrusions(case, results),
            np.array([r["residual"] for r in results]),
            times[1:, 0],
            times[1:, 1],
            float(times[0, 1]),
            3 * int((~mesh.fixed(case.sensor.contact.bonded)).sum()),
        )


def _protrusions(case: Case, results: list[dict]) -> np.ndarray:
    forces = np.array([r["protrusion_force_N"] for r in results])
    return forces if case.sensor.contact.board else forces[:, :0]


def _displacements(path: Path, depths: list[float], places: np.ndarray) -> np.ndarray:
    """Return the table's displacements in the order of ``places``, shape (d, n, 3)."""
    table = {name: pq.read_table(path)[name].to_numpy() for name in ("depth", "x", "y", "ux", "uy", "uz")}
    wanted = np.lexsort(places.round(6).T)
    fields = np.empty((len(depths), len(places), 3))
    for row, depth in zip(fields, depths, strict=True):
        at = np.abs(table["depth"] - depth) < 1e-9
        there = np.stack([table["x"][at], table["y"][at]], axis=-1)
        order = np.lexsort(there.round(6).T)
        if len(order) != len(wanted) or np.abs(there[order] - places[wanted]).max() > 1e-6:
            raise PeerError(f"{path}: its nodes are not those of the mesh handed to the other codes")
        row[wanted] = np.stack([table[k][at][order] for k in ("ux", "uy", "uz")], axis=-1)
    return fields
