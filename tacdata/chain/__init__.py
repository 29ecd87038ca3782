"""The forward chain: paths and readings, the response that it starts from, and the stages in between."""

from tacdata.chain.course import Course, Tool
from tacdata.chain.forward import Chain, Prediction, predict
from tacdata.chain.response import Response
from tacdata.chain.state import STAGES, State

__all__ = ["STAGES", "Chain", "Course", "Prediction", "Response", "State", "Tool", "predict"]
