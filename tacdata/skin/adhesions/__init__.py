"""Laws of adhesion, one per file; `adhesion_law.py` states the contents of a file."""

from tacdata.skin.adhesions.adhesion_law import AdhesionLaw, load_adhesion_law

__all__ = ["AdhesionLaw", "load_adhesion_law"]
