# %% [markdown]
# # Train on eight presses
#
# A network that ships with tacdata was trained on simulated presses of the default sensor. A few presses of your own
# unit adapt it. Here eight simulated presses of another specimen take the place of recorded ones. With recordings, the
# data set comes from `td.label(session)` and `td.pack(session, "dataset")`.

# %%
import tacdata as td

presses = td.simulate("dataset", 8, seed=7)
dataset = presses.dataset
dataset

# %% [markdown]
# Some of the presses are held out for the score. Ten epochs keep this page quick; the default stops by itself.

# %%
network = td.train("dataset", "network", start="shipped", epochs=10)
network

# %%
evaluation = td.evaluate(network)
evaluation

# %% [markdown]
# A prediction is a depth map for each reading.

# %%
session = td.example_session("session")
prediction = network.predict(session[1])
print(prediction.depth.shape, "deepest pixel", round(float(prediction.depth.max()), 2), "mm")
peak = session[1].label.depth.max()
print(f"label: {peak:.2f} mm")

# %%
prediction.plot()
