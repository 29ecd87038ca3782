"""Every equilibrium that presses pass, wanted or not: what derivatives along a load path need."""

from __future__ import annotations

from tacdata.skin.solve.configuration import Configuration


class PathRecorder:
    """Keeps what `Batch.run` tells its observer; the first of a press is the touch, without load.

    >>> from tacdata.skin.derivatives.recorder import PathRecorder
    >>> recorder = PathRecorder()
    >>> recorder("an equilibrium")
    >>> recorder.take(), recorder.take()
    (['an equilibrium'], [])
    """

    def __init__(self) -> None:
        """Start empty."""
        self._reached: list[Configuration] = []

    def __call__(self, reached: Configuration) -> None:
        """Keep an equilibrium."""
        self._reached.append(reached)

    def take(self) -> list[Configuration]:
        """Return the equilibria since the last call."""
        taken, self._reached = self._reached, []
        return taken
