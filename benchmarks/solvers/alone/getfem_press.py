"""Solve a press with GetFEM on a given mesh. Stand-alone: Debian's Python with ``python3-getfem``, and NumPy.

    /usr/bin/python3 getfem_press.py MESH.npz PRESS.json RESULT.npz

MESH.npz: nodes (n, 3), tets (e, 10), outer (f, 6), protrusions (p, 6), taxel (p,), fixed (n,).
PRESS.json: written by `benchmarks/solvers/getfem.py`: law and shape as GWFL text, numbers, quadrature, depths.
RESULT.npz: depth, displacement (d, n, 3), force (d, 3), protrusion_force (d, t), residual, newton, seconds,
cpu_seconds (d,), dofs, setup_cpu_seconds.

Displacements are isoparametric FEM_PK(3,2). Contact is unilateral with Coulomb friction by the augmented Lagrangian
of Alart and Curnier (1991): a field of multipliers on the contact faces, found with the displacements by Newton's
method. Or, without friction, an active set of multipliers at the nodes: each closes the mean gap under its hat, or is
0.
"""

import json
import sys
import time

import getfem
import numpy as np

OUTER, BUMPS, FIRST_TAXEL = 1, 2, 100
AT_NODES = "IM_STRUCTURED_COMPOSITE(IM_NC(3,1),2)"
"""Quadrature whose points are the nodes of the hats: it weighs each by itself."""
LARGE = 1e6
"""Weight that holds the multipliers of open nodes at -gap / LARGE [mm/MPa]: at 0, but for the sign of the gap."""
EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))


def read_mesh(arrays):
    """Return GetFEM's mesh with its regions, and our node of each of its displacement nodes."""
    corners = np.vstack([np.zeros(3), np.eye(3)])
    ours = np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in EDGES]])
    curved = getfem.GeoTrans("GT_PK(3,2)")
    theirs = curved.pts().T
    order = np.array([np.abs(ours - point).sum(axis=1).argmin() for point in theirs])
    nodes, tets = arrays["nodes"], arrays["tets"]
    mesh = getfem.Mesh("empty", 3)
    mesh.add_convex(curved, np.ascontiguousarray(nodes[tets[:, order]].transpose(2, 1, 0)))
    owner = {}
    for tet, four in enumerate(np.sort(tets[:, :4], axis=1).tolist()):
        for out in range(4):
            owner[tuple(four[:out] + four[out + 1 :])] = tet
    # GetFEM numbers a simplex' faces by the corner opposite to them.
    corner_place = {c: k for k, c in enumerate(order[[0, 2, 5, 9]].tolist())}

    def region(number, faces):
        pairs = []
        for three in np.sort(faces[:, :3], axis=1).tolist():
            tet = owner[tuple(three)]
            opposite = next(k for k in range(4) if tets[tet, k] not in three)
            pairs.append((tet, corner_place[opposite]))
        if pairs:
            mesh.set_region(number, np.array(pairs).T)

    region(OUTER, arrays["outer"])
    region(BUMPS, arrays["protrusions"])
    for taxel in np.unique(arrays["taxel"]):
        region(FIRST_TAXEL + int(taxel), arrays["protrusions"][arrays["taxel"] == taxel])
    return mesh, order


def node_dofs(space, tets, order, count):
    """Return the displacement dofs of each of our nodes, shape (n, 3)."""
    dofs = np.empty((count, 3), dtype=int)
    for tet in range(len(tets)):
        own = np.asarray(space.basic_dof_from_cvid(tet)[0]).reshape(-1, 3)
        dofs[tets[tet, order]] = own
    return dofs


class Press:
    """GetFEM's model of one press."""

    def __init__(self, arrays, press):
        self.arrays, self.press = arrays, press
        self.mesh, order = read_mesh(arrays)
        every = getfem.MeshFem(self.mesh, 3)
        every.set_fem(getfem.Fem("FEM_PK(3,2)"))
        self.dofs = node_dofs(every, arrays["tets"], order, len(arrays["nodes"]))
        self.free = np.sort(self.dofs[~arrays["fixed"]].ravel())
        self.space = getfem.MeshFem("partial", every, self.free)
        self.every_count = every.nbdof()
        self.inside = getfem.MeshIm(self.mesh, getfem.Integ(press["volume_rule"]))
        self.model = getfem.Model("real")
        self.model.add_fem_variable("u", self.space)
        for name, value in press["constants"].items():
            self.model.add_initialized_data(name, [value])
        self.model.add_macro("F", "(Id(3)+Grad_u)")
        if press.get("hydro"):
            hydro = getfem.MeshFem(self.mesh, 1)
            hydro.set_fem(getfem.Fem(press["hydro"]))
            self.model.add_fem_variable("hydro", hydro)
        self.model.add_nonlinear_term(self.inside, press["law"])
        self.taxels = [] if press["board"] is None else sorted(np.unique(arrays["taxel"]).tolist())
        self.active_set = press["contact"] == "active set"
        self.at_nodes, self.held_by = getfem.MeshIm(self.mesh, getfem.Integ(AT_NODES)), []
        self.surface, self.board_surface = (
            getfem.MeshIm(self.mesh, getfem.Integ(press[rule])) for rule in ("surface_rule", "board_rule")
        )
        self._indenter()
        if press["board"] is not None:
            self._board()

    def _multiplier(self, name, region, components):
        space = getfem.MeshFem(self.mesh, components)
        space.set_fem(getfem.Fem(self.press["multiplier"]))
        self.model.add_filtered_fem_variable(name, space, region)
        return space

    def _constrain(self, name, region, rule, term):
        """Add multipliers at nodes, all open."""
        self._multiplier(name, region, 1)
        space = self.model.mesh_fem_of_variable(name)
        self.model.add_initialized_fem_data(f"open_{name}", space, np.ones(space.nbdof()))
        self.model.add_initialized_data(f"large_{name}", [LARGE])
        self.model.add_nonlinear_term(rule, term, region)
        self.model.add_linear_term(self.at_nodes, f"large_{name}*open_{name}*{name}*Test_{name}", region)
        self.held_by.append(name)

    def _indenter(self):
        model, press = self.model, self.press
        self.tip = np.array(press["tip"], dtype=float)
        for name in ("tip", "moved"):
            model.add_initialized_data(name, self.tip if name == "tip" else np.zeros(3))
        model.add_fem_data("u_before", self.space)
        # To the indenter's frame; the rotation from it, row by row, is its inverse column by column.
        model.add_initialized_data("turn", np.ravel(press["turn"]), [3, 3])
        model.add_macro("p", "(turn*(X+u-tip))")
        for name, text in press["shape"]:
            model.add_macro(name, text)
        model.add_macro("n", "(turn'*Normalized(core))")
        model.add_macro("gap", f"(Norm(core)-{press['edge']!r})")
        if self.active_set:
            model.add_macro("traction", "(pressure*n)")
            self._constrain("pressure", OUTER, self.surface, "-traction.Test_u+gap*Test_pressure")
        elif press["friction"] == 0:
            self._multiplier("pressure", OUTER, 1)
            model.add_macro("traction", "(pressure*n)")
            model.add_nonlinear_term(
                self.surface, "-traction.Test_u+(1/r)*(pressure-pos_part(pressure-r*gap))*Test_pressure", OUTER
            )
        else:
            self._multiplier("traction", OUTER, 3)
            model.add_macro("slip", "((Id(3)-n@n)*(u-u_before-moved))")
            model.add_macro("load", "pos_part(traction.n-r*gap)")
            model.add_macro("shear", "Ball_projection((Id(3)-n@n)*traction-r_t*slip,friction*load)")
            model.add_nonlinear_term(
                self.surface, "-traction.Test_u+(1/r)*(traction-load*n-shear).Test_traction", OUTER
            )

    def _board(self):
        model, board = self.model, self.press["board"]
        model.add_macro("board_gap", f"((X+u)(3)-({board!r}))")
        if self.active_set:
            self._constrain("lift", BUMPS, self.board_surface, "-lift*Test_u(3)+board_gap*Test_lift")
            return
        self._multiplier("lift", BUMPS, 1)
        model.add_nonlinear_term(
            self.board_surface, "-lift*Test_u(3)+(1/r)*(lift-pos_part(lift-r*board_gap))*Test_lift", BUMPS
        )

    def go_to(self, depth):
        """Move the indenter from where it is to ``depth`` and find the equilibrium; return Newton steps, residual."""
        model = self.model
        before = model.variable("tip")
        now = self.tip - [0, 0, depth]
        model.set_variable("moved", now - before)
        model.set_variable("u_before", model.variable("u"))
        model.set_variable("tip", now)
        taken = self._settle(depth) if self.active_set else self._newton(depth)
        model.assembly("build_rhs")
        return taken, float(np.abs(model.rhs()).max())

    def _newton(self, depth):
        """Find the equilibrium; return the steps of Newton's method."""
        steps, converged = self.model.solve(
            "max_res",
            self.press["residual"],
            "max_iter",
            self.press["max_newton"],
            "lsolver",
            "mumps",
            "lsearch",
            "simplest",
            "alpha min",
            0.3,
            *(["noisy"] if "--noisy" in sys.argv else []),
        )
        if not converged:
            raise SystemExit(f"GetFEM found no equilibrium at {depth} mm in {steps} Newton steps")
        return steps

    def _settle(self, depth):
        """Close open nodes whose mean gap is negative, open closed ones that pull, until nothing changes."""
        taken = 0
        for _ in range(40):
            taken += self._newton(depth)
            changed = 0
            for name in self.held_by:
                before, value = self.model.variable(f"open_{name}"), self.model.variable(name)
                now = np.where(value > 0, 0.0, np.where(value < 0, 1.0, before))
                changed += int((now != before).sum())
                self.model.set_variable(f"open_{name}", now)
            if not changed:
                return taken
        raise SystemExit(f"GetFEM's active set does not settle at {depth} mm")

    def forces(self):
        """Return the force on the indenter, shape (3,), and on each protrusion, shape (t,) [N]."""
        own = [getfem.asm_generic(self.surface, 0, f"traction({k})", OUTER, self.model) for k in (1, 2, 3)]
        lift = [getfem.asm_generic(self.board_surface, 0, "lift", FIRST_TAXEL + t, self.model) for t in self.taxels]
        return -np.ravel(own), np.ravel(lift)

    def displacement(self):
        """Return the displacements of our nodes [mm], shape (n, 3)."""
        every = np.zeros(self.every_count)
        every[self.free] = self.model.variable("u")
        return every[self.dofs]


def main(mesh_file, press_file, result_file):
    """Solve the press and write the result."""
    getfem.util_trace_level(0)
    getfem.util_warning_level(0)
    began = time.process_time()
    with np.load(mesh_file, allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored.files}
    with open(press_file) as file:
        press = json.load(file)
    case = Press(arrays, press)
    setup = time.process_time() - began
    rows = {
        name: []
        for name in (
            "depth",
            "displacement",
            "force",
            "protrusion_force",
            "residual",
            "newton",
            "seconds",
            "cpu_seconds",
        )
    }
    last = 0.0
    for depth in press["depths"]:
        wall, cpu, newton = time.perf_counter(), time.process_time(), 0
        parts = max(1, int(np.ceil(abs(depth - last) / press["step"] - 1e-9)))
        for part in range(1, parts + 1):
            steps, residual = case.go_to(last + (depth - last) * part / parts)
            newton += steps
        last = depth
        force, lift = case.forces()
        seconds = time.perf_counter() - wall, time.process_time() - cpu
        state = (depth, case.displacement(), force, lift, residual, newton)
        for name, value in zip(rows, (*state, *seconds), strict=True):
            rows[name].append(value)
        print(f"{depth:g} mm: {force.round(6).tolist()} N, {newton} Newton steps, {seconds[0]:.1f} s", flush=True)
    np.savez_compressed(
        result_file,
        dofs=case.model.nbdof(),
        setup_cpu_seconds=setup,
        **{name: np.array(values) for name, values in rows.items()},
    )


if __name__ == "__main__":
    main(*sys.argv[1:4])
