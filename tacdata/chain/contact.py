"""Contact that cannot pull."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain.state import State


def let_go(state: State) -> State:
    """Return a state in which skin and tool only push: no load where the force would pull.

    A skin that has relaxed under a hold is left by the tool before the tool is back where it first touched.
    """
    pushes = state.force > 0
    return replace(state, load=np.where(pushes[:, None], state.load, 0.0), force=np.where(pushes, state.force, 0.0))
