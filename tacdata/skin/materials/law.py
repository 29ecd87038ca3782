"""Base class of the material laws, and the contents of a law's file.

``tacdata/skin/materials/my_law.py`` defines one frozen dataclass derived from `Law`. A sensor or case file names it by
its file's name. Its fields are parameters in addition to Young's modulus and Poisson's ratio: pure numbers, whose
defaults make the law Neo-Hookean, set under ``material/parameters``.

All Warp functions exist for double and single precision (``real``), and take either the deformation gradient F or the
displacement gradient H = F - I (``of``). From H they keep all digits at small strain; from F, those that F has.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, ClassVar, Literal, NamedTuple, Self

from tacdata import registry
from tacdata.errors import FormatError
from tacdata.sensor import Material
from tacdata.skin.constitutive import kinematics
from tacdata.warp_runtime import wp

ROOM, BASE = "tacdata.skin.materials", "law"

Gradient = Literal["F", "H"]


class LawFunctions(NamedTuple):
    """Warp functions of one law in one precision; the first argument is H, the last the law's numbers."""

    energy: wp.Function
    """``f(H, m)``: energy per undeformed volume W [N/mm^2 = MPa]."""
    stress: wp.Function
    """``f(H, m)``: first Piola-Kirchhoff stress P = dW/dF [MPa]."""
    tangent: wp.Function
    """``f(H, dF, m)``: directional derivative of P along dF [MPa]."""


@dataclass(frozen=True)
class Law(ABC):
    """A strain energy density W(F), isotropic, with W = 0 and P = 0 at F = I; NaN where det F <= 0."""

    splits_volume: ClassVar[bool] = True
    """Whether the volumetric part is kappa/2 (J - 1)^2 by itself. Only then may it be averaged over elements: the
    rest of another form without it is unbounded below at single points."""

    @classmethod
    def example(cls) -> Self:
        """Return a typical one, unlike the default if there are parameters; conformance tests use it."""
        return cls()

    @abstractmethod
    def numbers(self, shear_modulus: float, bulk_modulus: float) -> tuple[float, ...]:
        """Return at most 8 numbers for the Warp functions, from the moduli at small strain [MPa]."""

    @staticmethod
    @abstractmethod
    def functions(real: type) -> LawFunctions:
        """Return the law's Warp functions for ``real``, the same objects at every call (``@staticmethod @cache``)."""

    @staticmethod
    @cache
    def bulk_function(real: type) -> wp.Function:
        """Return ``f(m)``: the bulk modulus at small strain [MPa] from the law's numbers; kappa is usually m[1]."""
        return _second(real)

    def complaint(self) -> str:
        """Return the fault of the parameters; empty if there is none."""
        return ""

    @property
    def name(self) -> str:
        """The law's name: its file's name."""
        return type(self).__module__.rsplit(".", 1)[-1]

    def configured(self, values: dict[str, Any]) -> Self:
        """Return this law with the parameters of a sensor file.

        Raises:
            FormatError: If one is unknown, not a number, or out of its range.
        """
        known = {field.name: getattr(self, field.name) for field in fields(self)}
        if unknown := sorted(set(values) - set(known)):
            raise FormatError(
                f"material law {self.name} with the parameter {', '.join(unknown)}",
                ", ".join(known) or f"none: {self.name} has only Young's modulus and Poisson's ratio",
                "correct material/parameters; `tacdata list materials` shows what each law takes",
            )
        numbers = {name: _of_kind(old, self.name, name, values.get(name, old)) for name, old in known.items()}
        result = type(self)(**numbers)
        if complaint := result.complaint():
            raise FormatError(
                f"material law {self.name}: {complaint}",
                "a stable material with the stated moduli",
                "correct material/parameters",
            )
        return result

    def parameters(self, material: Material) -> tuple[float, ...]:
        """Return at most 8 numbers for the Warp functions, from a sensor's elastic constants and parameters.

        Raises:
            FormatError: If a parameter is unknown or out of its range.
        """
        law = self.configured(material.parameters)
        return law.numbers(material.shear_modulus, material.bulk_modulus)

    def energy_function(self, real: type | None = None, of: Gradient = "F") -> wp.Function:
        """Return ``f(F: mat33, m: vector(8, real)) -> real``: energy per undeformed volume [N/mm^2 = MPa]."""
        return _function(type(self), "energy", real, of)

    def stress_function(self, real: type | None = None, of: Gradient = "F") -> wp.Function:
        """Return ``f(F, m) -> mat33``: first Piola-Kirchhoff stress P = dW/dF [MPa]."""
        return _function(type(self), "stress", real, of)

    def tangent_function(self, real: type | None = None, of: Gradient = "F") -> wp.Function:
        """Return ``f(F, dF, m) -> mat33``: directional derivative of P along dF [MPa]."""
        return _function(type(self), "tangent", real, of)


@cache
def _second(real: type) -> wp.Function:
    numbers = kinematics.parameters(real)

    @wp.func
    def second(m: numbers):
        return m[1]

    return second


def _function(kind: type[Law], quantity: str, real: type | None, of: Gradient) -> wp.Function:
    real = wp.float64 if real is None else real
    if real not in (wp.float64, wp.float32):
        raise TypeError(f"{kind.__name__}: real = {real!r}, allowed are warp.float64 and warp.float32")
    inner = getattr(kind.functions(real), quantity)
    return inner if of == "H" else _of_deformation(inner, real, quantity == "tangent")


@cache
def _of_deformation(inner: wp.Function, real: type, directional: bool) -> wp.Function:
    """Return a function of F from one of H. The difference F - I is exact where F is near I."""
    mat33, numbers = kinematics.matrix(real), kinematics.parameters(real)

    @wp.func
    def of_state(F: mat33, m: numbers):
        return inner(F - wp.identity(n=3, dtype=real), m)

    @wp.func
    def of_direction(F: mat33, dF: mat33, m: numbers):
        return inner(F - wp.identity(n=3, dtype=real), dF, m)

    return of_direction if directional else of_state


def _of_kind(default: Any, law: str, name: str, value: Any) -> Any:
    """Return a parameter as a float, or as a tuple of floats where its default is one."""
    listed = isinstance(default, tuple)
    items = list(value) if isinstance(value, list | tuple) else [value]
    finite = all(isinstance(v, int | float) and not isinstance(v, bool) and abs(v) < float("inf") for v in items)
    if listed != isinstance(value, list | tuple) or not finite:
        raise FormatError(
            f"material law {law}: {name} = {value!r}",
            "a list of finite numbers" if listed else "one finite number",
            "correct material/parameters",
        )
    return tuple(float(v) for v in items) if listed else float(value)


def load_law(name: str) -> Law:
    """Return the law called ``name``, with its default parameters.

    Raises:
        UsageError: If there is no such file.
    """
    kind: type[Law] = registry.load(ROOM, BASE, name, Law)
    return kind()
