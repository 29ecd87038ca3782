"""Press plans: what will be pressed where, how deep and how fast, as files."""

from tacdata.plans.plan import Plan, Press, read_plan

__all__ = ["Plan", "Press", "read_plan"]
