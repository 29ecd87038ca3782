# %% [markdown]
# # Simulate and pretrain
#
# For a sensor of your own, no network ships. The skin model can provide training data without a recording: random
# presses, solved by finite elements, with readings of many units. Four presses show the steps; a useful network needs
# thousands.

# %%
import tacdata as td

simulated = td.simulate("simulated", 4, seed=1)
print(simulated.episodes, "episodes,", simulated.frames, "frames,", simulated.specimens, "specimens")

# %%
simulated.dataset

# %%
simulated.dataset.plot()

# %% [markdown]
# Solved presses are kept. The same command with more presses continues, and other noise costs no new solution.
#
# The network `pattern` learns from forces on the protrusions instead of readings, so it is independent of a unit's
# gains.

# %%
pretrained = td.train("simulated", "pretrained", network="pattern", epochs=20)
pretrained

# %% [markdown]
# Later, `td.train("dataset", "network", start="pretrained")` adapts it to recorded presses.
