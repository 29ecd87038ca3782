"""Press a sphere into a slab with Newton's VBD solver. Stand-alone: a Python with ``newton`` and NumPy.

    python newton_press.py PRESS.json RESULT.npz

Units are mm, N, MPa, s, tonnes. Statics by dynamics: velocities are set to zero before every step, so that only the
positions go on; half of a depth's steps move the sphere, half let the skin settle. Newton's law is the stable
Neo-Hookean form, its tetrahedra are linear, contact is a penalty at vertices. The force is the sum of the vertices'
penalties. `moved` is the largest distance that a vertex still went in a depth's last five steps.
"""

import json
import sys
import time

import numpy as np

DENSITY = 1e-9  # of water [t/mm^3]


def build(press):
    """Return model, solver, two states, contacts and the pipeline that finds them."""
    import newton

    from tacdata.warp_runtime import wp

    wp.config.quiet = True
    h = press["spacing"]
    size = np.array(press["size"])
    counts = [round(s / h) for s in size]
    cell = [float(s / c) for s, c in zip(size, counts, strict=True)]
    builder = newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=(0.0, 0.0, 0.0))
    builder.add_soft_grid(
        pos=wp.vec3(-size[0] / 2, -size[1] / 2, 0.0),
        rot=wp.quat_identity(),
        vel=wp.vec3(0.0, 0.0, 0.0),
        dim_x=counts[0],
        dim_y=counts[1],
        dim_z=counts[2],
        cell_x=cell[0],
        cell_y=cell[1],
        cell_z=cell[2],
        density=DENSITY,
        k_mu=press["mu"],
        k_lambda=press["lambda"],
        k_damp=0.0,
        particle_radius=1e-4,
    )
    for k, place in enumerate(builder.particle_q):
        if place[2] < 1e-6:
            builder.particle_mass[k] = 0.0
    config = newton.ModelBuilder.ShapeConfig(ke=press["penalty"], kd=0.0, mu=press["friction"], density=0.0)
    tip = builder.add_body(xform=wp.transform(wp.vec3(*press["tip"]), wp.quat_identity()), mass=0.0)
    builder.add_shape_sphere(
        tip,
        radius=press["radius"],
        cfg=config,
        xform=wp.transform(wp.vec3(0.0, 0.0, press["radius"]), wp.quat_identity()),
    )
    builder.color()
    model = builder.finalize(device="cpu")
    model.soft_contact_ke, model.soft_contact_kd, model.soft_contact_mu = press["penalty"], 0.0, press["friction"]
    solver = newton.solvers.SolverVBD(
        model,
        iterations=press["iterations"],
        integrate_with_external_rigid_solver=True,
        particle_enable_self_contact=False,
        particle_enable_tile_solve=False,
    )
    pipeline = newton.CollisionPipeline(model, soft_contact_margin=0.5)
    return model, solver, [model.state(), model.state()], pipeline.contacts(), pipeline


def main(press_file, result_file):
    """Solve the press and write the result."""
    began = time.process_time()
    with open(press_file) as file:
        press = json.load(file)
    model, solver, states, contacts, pipeline = build(press)
    control = model.control()
    rest = states[0].particle_q.numpy().astype(float)
    top = np.flatnonzero(np.abs(rest[:, 2] - press["size"][2]) < 1e-6)
    tip = np.array(press["tip"])
    rows = {name: [] for name in ("depth", "displacement", "force", "moved", "seconds", "cpu_seconds")}

    def step(depth):
        for state in states:
            state.body_q.assign([[*(tip - [0, 0, depth]), 0.0, 0.0, 0.0, 1.0]])
            state.body_qd.zero_()
            state.particle_qd.zero_()
        states[0].clear_forces()
        pipeline.collide(states[0], contacts)
        solver.step(states[0], states[1], control, contacts, press["time_step"])
        states.reverse()

    step(0.0)
    setup, last = time.process_time() - began, 0.0
    for depth in press["depths"]:
        wall, cpu, half = time.perf_counter(), time.process_time(), press["steps"] // 2
        for k in range(half):
            step(last + (depth - last) * (k + 1) / half)
        for k in range(half):
            if k == max(half - 5, 0):
                before = states[0].particle_q.numpy().astype(float)
            step(depth)
        place, last = states[0].particle_q.numpy().astype(float), depth
        centre = tip + np.array([0, 0, press["radius"] - depth])
        away = place[top] - centre
        distance = np.linalg.norm(away, axis=1)
        overlap = np.maximum(press["radius"] + 1e-4 - distance, 0)
        force = float(-(press["penalty"] * overlap * away[:, 2] / distance).sum())
        seconds = time.perf_counter() - wall, time.process_time() - cpu
        moved = float(np.linalg.norm(place - before, axis=1).max())
        for name, value in zip(rows, (depth, place[top] - rest[top], force, moved, *seconds), strict=True):
            rows[name].append(value)
        print(f"{depth:g} mm: {force:.5f} N, moved {moved:.2e} mm, {seconds[1]:.2f} CPU s", flush=True)
    np.savez_compressed(
        result_file,
        places=rest[top, :2],
        dofs=3 * int((rest[:, 2] > 1e-6).sum()),
        setup_cpu_seconds=setup,
        **{name: np.array(values) for name, values in rows.items()},
    )


if __name__ == "__main__":
    main(*sys.argv[1:3])
