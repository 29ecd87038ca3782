"""Transduction: from loads on protrusions to capacitance and counts, with derivatives and inverse."""

from tacdata.transduction.loads import Loads
from tacdata.transduction.transducer import TaxelReadings, Transducer

__all__ = ["Loads", "TaxelReadings", "Transducer"]
