# %% [markdown]
# # Look at a session
#
# A session is a folder of recorded presses. Two of them ship with tacdata, with their labels: depth maps that were
# computed by finite elements.

# %%
import tacdata as td

session = td.example_session("session")
session

# %% [markdown]
# One recording is an episode. It has readings, times and the path of the tip on one clock.

# %%
episode = session[1]
episode

# %%
print(episode.readings.shape, "readings [counts]: frames, taxels")
print(episode.times[-1], "s")
print(episode.depth.max(), "mm deep at most")

# %% [markdown]
# `tared` are the readings minus their mean at rest. The taxel with the largest change is near the press.

# %%
peak = abs(episode.tared).max(axis=0)
print("taxel", peak.argmax(), "changes by", round(float(peak.max())), "counts")
print(episode.press)

# %% [markdown]
# Readings, path, and the label of the same press:

# %%
episode.plot()

# %%
label = episode.label
label

# %%
label.plot()

# %% [markdown]
# `to_pandas()` gives one row per reading, for analysis of your own.

# %%
table = episode.to_pandas()
print(table.groupby("phase", sort=False)["time_s"].agg(["min", "max"]))
