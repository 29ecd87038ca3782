"""Press a sphere into a slab with MuJoCo's flex. Stand-alone: a Python with ``mujoco`` and NumPy.

    python mujoco_press.py PRESS.json RESULT.npz

Units are mm, N, MPa, s, tonnes. A grid flex of linear tetrahedra, its lowest layer pinned, under a sphere moved as a
mocap body; time steps go on until no vertex moves more than `settled` of the depth in ten steps, or `limit` steps are
over. MuJoCo's elasticity is St. Venant and Kirchhoff's, its contact a soft constraint at one point a tetrahedron.
`moved` is the largest distance that a vertex still went in the last ten steps.
"""

import json
import sys
import time

import mujoco
import numpy as np


def model_text(press):
    """Return the model in MJCF."""
    sx, sy, sz = press["size"]
    nx, ny, nz = (round(s / press["spacing"]) for s in press["size"])
    x, y, z = press["tip"]
    mass = press["density"] * sx * sy * sz
    friction = f'condim="3" friction="{press["friction"]} 0 0"' if press["friction"] else 'condim="1"'
    return f"""<mujoco>
<option gravity="0 0 0" timestep="{press["time_step"]}" solver="CG" integrator="discrete" iterations="200"/>
<size memory="400M"/>
<worldbody>
<body name="tip" mocap="true" pos="{x} {y} {z + press["radius"]}">
<geom type="sphere" size="{press["radius"]}" {friction}/></body>
<flexcomp name="skin" type="grid" dim="3" count="{nx + 1} {ny + 1} {nz + 1}" pos="0 0 {sz / 2}" radius="0.0001"
 spacing="{sx / nx} {sy / ny} {sz / nz}" mass="{mass}">
<contact selfcollide="none" {friction}/>
<elasticity young="{press["young"]}" poisson="{press["poisson"]}" damping="{press["damping"]}"/>
<pin gridrange="0 0 0 {nx} {ny} 0"/>
</flexcomp></worldbody></mujoco>"""


def contact_force(model, data):
    """Return the vertical force on the sphere [N]."""
    total, one = 0.0, np.zeros(6)
    for k in range(data.ncon):
        mujoco.mj_contactForce(model, data, k, one)
        total += abs(data.contact[k].frame.reshape(3, 3)[:, 2] @ one[:3])
    return total


def main(press_file, result_file):
    """Solve the press and write the result."""
    began = time.process_time()
    with open(press_file) as file:
        press = json.load(file)
    model = mujoco.MjModel.from_xml_string(model_text(press))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rest = data.flexvert_xpos.reshape(-1, 3).copy()
    top = np.flatnonzero(np.abs(rest[:, 2] - press["size"][2]) < 1e-6)
    height = data.mocap_pos[0, 2]
    rows = {name: [] for name in ("depth", "displacement", "force", "moved", "seconds", "cpu_seconds")}
    setup, last = time.process_time() - began, 0.0
    for depth in press["depths"]:
        wall, cpu, moved = time.perf_counter(), time.process_time(), np.inf
        before = data.flexvert_xpos.reshape(-1, 3).copy()
        for k in range(press["limit"]):
            data.mocap_pos[0, 2] = height - (last + (depth - last) * min(1.0, (k + 1) / press["steps"]))
            mujoco.mj_step(model, data)
            if (k + 1) % 10 == 0:
                place = data.flexvert_xpos.reshape(-1, 3).copy()
                moved, before = float(np.linalg.norm(place - before, axis=1).max()), place
                if k >= press["steps"] + 10 and moved < press["settled"] * depth:
                    break
        last, force = depth, contact_force(model, data)
        place = data.flexvert_xpos.reshape(-1, 3).copy()
        seconds = time.perf_counter() - wall, time.process_time() - cpu
        for name, value in zip(rows, (depth, place[top] - rest[top], force, moved, *seconds), strict=True):
            rows[name].append(value)
        print(f"{depth:g} mm: {force:.5f} N, moved {moved:.2e} mm in {k + 1} steps, {seconds[1]:.2f} CPU s", flush=True)
    np.savez_compressed(
        result_file,
        places=rest[top, :2],
        dofs=int(model.nv),
        setup_cpu_seconds=setup,
        **{name: np.array(values) for name, values in rows.items()},
    )


if __name__ == "__main__":
    main(*sys.argv[1:3])
