"""All alarms of a model's residual."""

from __future__ import annotations

from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.alarms.channel_drops import channel_drops
from tacdata.discrepancy.alarms.channel_histories import channel_histories
from tacdata.discrepancy.alarms.cleaned import Cleaned
from tacdata.discrepancy.alarms.motor_lines import hum, motor_lines
from tacdata.discrepancy.alarms.press_depths import press_depths
from tacdata.discrepancy.alarms.swings import swings
from tacdata.discrepancy.search.problem import Problem


def alarms(problem: Problem, form_error: float = 0.0) -> tuple[Alarm, ...]:
    """Return the alarms of the residual of a problem's model.

    Args:
        problem: The model, with the effects of the answer.
        form_error: Model error of their forms: half a sum of squares [1].
    """
    cleaned = Cleaned.of(problem, form_error)
    # A disturbance during motion shows in more than one test: the finest that sees it reports.
    moving = channel_histories(cleaned) or swings(cleaned) or motor_lines(cleaned)
    return (*moving, *hum(cleaned), *press_depths(cleaned), *channel_drops(cleaned))
