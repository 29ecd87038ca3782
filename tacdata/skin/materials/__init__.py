"""Hyperelastic laws, one per file; see `law.py` for what a file must hold."""

from tacdata.skin.materials.law import Law, load_law

__all__ = ["Law", "load_law"]
