# %% [markdown]
# # Import a stranger's CSV
#
# Another lab sends a file per press: a time in ms, the depth of its stage in µm, and two pads in pF. First, we write
# such files. With files of your own, skip this cell.

# %%
from pathlib import Path

import numpy as np

import tacdata as td

folder = Path("measured")
folder.mkdir()
noise = np.random.default_rng(0)
for number in range(4):
    time = np.arange(0.0, 6.0, 0.02)
    depth = np.interp(time, [1, 2, 4, 5], [-0.3, 0.8, 0.8, -0.3])
    load = np.maximum(depth, 0.0) ** 1.5
    pads = np.column_stack([100 + 50 * load, 90 + 20 * load]) + noise.normal(0, 0.1, (len(time), 2))
    rows = np.column_stack([1000 * (time + 10 * number), 1000 * depth, pads])
    np.savetxt(folder / f"press_{number}.csv", rows, "%.3f", ";", header="Zeit [ms];Weg [um];Pad 1;Pad 2", comments="")
print((folder / "press_0.csv").read_text()[:120])

# %% [markdown]
# A mapping assigns columns to quantities, with their units.
# `tacdata import measured --propose mapping.yaml` writes a draft.

# %%
Path("mapping.yaml").write_text("""
version: "1.0"
name: two pads
files:
  log: {path: "press_{trial}.csv", time: {column: "Zeit [ms]", unit: ms, zero: shared}}
sensor: {name: two pads, columns: 2, rows: 1, pitch_x: 4.0, pitch_y: 4.0}
taxels: {file: log, columns: "Pad*", unit: pF}
position: {file: log, depth: {column: "Weg [um]", unit: um}}
indenter: {shape: sphere, radius: 3.0}
""")
imported = td.import_files(folder, "mapping.yaml", "session")
session = td.open("session")
session

# %% [markdown]
# Imported recordings are sessions like any other. The check reports faults, and the quantities that it cannot assess.

# %%
episode = session[0]
episode

# %%
episode.plot()

# %%
print(td.check("session").text)
