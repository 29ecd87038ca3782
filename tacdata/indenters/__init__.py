"""Rigid indenters, one shape per file; see `indenter.py` for what a file must hold."""

from tacdata.indenters.indenter import Indenter, from_document

__all__ = ["Indenter", "from_document"]
