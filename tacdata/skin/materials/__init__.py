"""Hyperelastic laws, one per file; `law.py` states the contents of a file."""

from tacdata.skin.materials.law import Law, load_law

__all__ = ["Law", "load_law"]
