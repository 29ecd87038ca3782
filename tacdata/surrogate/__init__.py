"""The skin's finite-element model as a table that answers in microseconds."""

from tacdata.surrogate.build import LeftOut, TableSettings, Work, work
from tacdata.surrogate.grid import Reach
from tacdata.surrogate.spec import written_spec
from tacdata.surrogate.table import LoadTable

__all__ = ["LeftOut", "LoadTable", "Reach", "TableSettings", "Work", "work", "written_spec"]
