"""Sessions of a healthy machine and of another, read together so that their channels and clocks agree."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.data.recordings import course_of
from tacdata.errors import UsageError


@dataclass(frozen=True)
class Sessions:
    """Both machines' recordings."""

    course: Course
    measured: np.ndarray
    """Whether an episode is of the machine that is judged, shape (episodes,), bool."""

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each episode's specimen; empty where the source names none."""
        return self.course.specimens or ("",) * self.course.episodes


def read_sessions(healthy: list[Path], measured: list[Path]) -> Sessions:
    """Read both machines' recordings.

    Args:
        healthy: Recordings or sessions of the healthy machine.
        measured: Those of the machine that is judged.

    Raises:
        UsageError: If one recording is given as both, or a session holds no readings.
        FormatError: If their channels differ.
    """
    overlap = {p.resolve() for p in healthy} & {p.resolve() for p in measured}
    if overlap:
        raise UsageError(
            f"{', '.join(map(str, sorted(overlap)))} as the machine and as its reference",
            "two sessions",
            "name the healthy session in --reference, the other one before it",
        )
    paths = [*healthy, *measured]
    course = course_of(paths)
    count = len(np.unique(course.session))
    if count != len(paths):
        raise UsageError(
            f"{len(paths) - count} of {len(paths)} sessions hold no press with readings",
            "presses in each",
            "check them",
        )
    return Sessions(course, course.session[np.arange(course.episodes)] >= len(healthy))
