"""The measured streams side by side, and a model's predictions of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.chain import Course, Prediction, Response


@dataclass(frozen=True)
class Streams:
    """Columns of the stacked streams: readings first, then force, then the tag's x, y and depth."""

    channels: int
    force: bool
    tag: bool
    rows: np.ndarray
    """Rows of the course at which something was read, shape (m,), int64."""

    @classmethod
    def of(cls, course: Course) -> Streams:
        """Return the streams that a course holds."""
        return cls(course.channels, course.force is not None, course.tag is not None, course.read)

    @property
    def count(self) -> int:
        """Number of streams."""
        return self.channels + self.force + 3 * self.tag

    @property
    def kinds(self) -> list[str]:
        """Kind of each stream."""
        return ["signal"] * self.channels + ["force"] * self.force + ["tag"] * (3 * self.tag)

    def names(self, course: Course) -> tuple[str, ...]:
        """Return the name of each stream, channels by their numbers in the recordings."""
        return (*course.channel_names, *["force"] * self.force, *["tag x", "tag y", "tag depth"] * self.tag)

    def measured(self, course: Course) -> np.ndarray:
        """Return the measured values at the rows that were read, shape (m, streams); NaN where missing or clipped."""
        parts = [course.readings if course.clipped is None else np.where(course.clipped, np.nan, course.readings)]
        if self.force and course.force is not None:
            parts.append(course.force[:, None])
        if self.tag and course.tag is not None:
            parts.append(course.tag)
        return np.column_stack(parts)[self.rows]

    def predicted(self, prediction: Prediction) -> np.ndarray:
        """Return a model's prediction at the rows that were read, shape (m, streams)."""
        parts = [prediction.signal[self.rows]]
        if self.force:
            parts.append(prediction.force[self.rows, None])
        if self.tag:
            parts.append(prediction.tag[self.rows])
        return np.concatenate(parts, axis=1) if len(parts) > 1 else parts[0]

    def rise(self, prediction: Prediction, response: Response) -> np.ndarray:
        """Return the rise under presses at the rows that were read, shape (m, streams): readings without their value in
        the air, force; 0 for the tag's."""
        result = self.predicted(prediction)
        result[:, : self.channels] -= response.signal(np.zeros((1, self.channels)))
        if self.tag:
            result[:, -3:] = 0.0
        return result
