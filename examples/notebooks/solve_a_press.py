# %% [markdown]
# # Solve a press and see its error
#
# The skin model computes the deformation of a skin under a rigid shape, by finite elements. Here a ball of 4 mm radius
# presses the default sensor 0.8 mm deep. The extra `fem` is needed.

# %%
import numpy as np

import tacdata as td

skin = td.Skin()
press = td.Press(td.indenter("sphere", radius=4.0), depth=0.8)
solution = skin.solve(press)
solution

# %% [markdown]
# Each state has a map of the outer face, the force, and the load on each protrusion. The numerical error comes from a
# second solution on a coarser mesh.

# %%
errors = np.sqrt(np.mean(solution.numerical**2, axis=(1, 2)))
for depth, force, error in zip(solution.depth, solution.force, errors, strict=True):
    print(f"{depth:.2f} mm deep: normal force {abs(force[2]):.3f} N, error of the map {1000 * error:.1f} um")

# %%
solution.plot()

# %% [markdown]
# The error is small compared with the depth, and compared with the noise of a real sensor.

# %%
deepest = int(np.argmax(solution.depth))
print(f"relative error at the deepest state: {errors[deepest] / solution.depth[deepest]:.2%}")
