# %% [markdown]
# # A verdict and its evidence
#
# Where recordings and a model disagree, tacdata searches for the missing physical effect. Here we hide a delay of
# 80 ms in 24 made-up presses at three speeds and two depths. The search does not know it.

# %%
from pathlib import Path

import numpy as np

import tacdata as td

HIDDEN = 0.08
folder = Path("measured")
folder.mkdir()
noise, clock = np.random.default_rng(3), 0.0
for number in range(24):
    deepest = (0.7, 1.0)[number % 2]
    way = (deepest + 0.3) / (0.5, 1.0, 3.0)[number // 2 % 3]
    corners = np.cumsum([0, 1.0, way, 1.5, way, 1.5])
    path = [-0.3, -0.3, deepest, deepest, -0.3, -0.3]
    time = np.arange(0, corners[-1], 1 / 30)
    load = np.maximum(np.interp(time - HIDDEN, corners, path), 0) ** 1.5
    pads = np.column_stack([100 + 50 * load, 90 + 20 * load]) + noise.normal(0, 0.1, (len(time), 2))
    rows = np.column_stack([clock + time, np.interp(time, corners, path), pads])
    np.savetxt(folder / f"press_{number:02d}.csv", rows, "%.5f", ",", header="t,depth,a,b", comments="")
    clock += corners[-1] + 2

# %%
Path("mapping.yaml").write_text("""
version: "1.0"
name: two pads
files:
  log: {path: "press_{trial}.csv", time: {column: t, unit: s, zero: shared}}
sensor: {name: two pads, columns: 2, rows: 1, pitch_x: 4.0, pitch_y: 4.0}
taxels: {file: log, columns: [a, b], unit: pF}
position: {file: log, depth: {column: depth, unit: mm}}
indenter: {shape: sphere, radius: 3.0}
""")
imported = td.import_files(folder, "mapping.yaml", "session")

# %% [markdown]
# No model of this sensor exists. So `judge` first fits a smooth response to the recordings, then tests every effect of
# the library.

# %%
verdict = td.judge("session", "verdict")
verdict

# %% [markdown]
# The status is the conclusion. Each effect has its parameters with standard errors.

# %%
print(verdict.status)
print(verdict.effects)

# %% [markdown]
# The text has the evidence: sizes of the residual, rivals, and the presses that were sealed during the search.

# %%
print(verdict.text)

# %%
verdict.plot()
