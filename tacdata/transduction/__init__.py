"""From what protrusions feel to what taxels read: capacitance and counts, their derivatives and inverse."""

from tacdata.transduction.loads import Loads
from tacdata.transduction.transducer import TaxelReadings, Transducer

__all__ = ["Loads", "TaxelReadings", "Transducer"]
