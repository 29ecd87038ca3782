"""Laws of adhesion, one per file; see `adhesion_law.py` for what a file must hold."""

from tacdata.skin.adhesions.adhesion_law import AdhesionLaw, load_adhesion_law

__all__ = ["AdhesionLaw", "load_adhesion_law"]
