"""Rigid indenters, one shape per file; `indenter.py` describes such a file."""

from tacdata.indenters.indenter import Indenter, from_document

__all__ = ["Indenter", "from_document"]
