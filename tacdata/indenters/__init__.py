"""Rigid indenters, one shape per file; `indenter.py` states the contents of a file."""

from tacdata.indenters.indenter import Indenter, from_document

__all__ = ["Indenter", "from_document"]
