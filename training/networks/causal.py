"""The paper's network over the newest nine frames: no look-ahead, so no delay beyond link and computing.

All but the window is as in `paper`. Information of the four future frames for the paper's network (whether a press is
still deepening) this one must guess from the past.
"""

from __future__ import annotations

from tacdata.training.networks.paper import Paper


class Causal(Paper):
    """Nine frames, the newest of which is the target."""

    offsets = (-8, -7, -6, -5, -4, -3, -2, -1, 0)
