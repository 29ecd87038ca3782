"""Press plans: indenter, place, depth and speed of each press, as files."""

from tacdata.plans.plan import Plan, Press, read_plan

__all__ = ["Plan", "Press", "read_plan"]
