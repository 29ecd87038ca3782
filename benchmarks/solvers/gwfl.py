"""Laws and indenters in GWFL, the language of weak forms that GetFEM reads.

A shape is a core and a rounding: its distance is |core| - rounding, where ``core`` leads to the point p (indenter
frame, mm) from the nearest point of the shape shrunk by its rounding. That holds near the surface, where contact is.
"""

from __future__ import annotations

import numpy as np

from tacdata.indenters import Indenter
from tacdata.sensor import Material

LAWS = {
    "neo_hookean": "mu/2*(pow(Det(F),-2/3)*Norm_sqr(F)-3)+kappa/2*sqr(Det(F)-1)",
    "neo_hookean_log": "mu/2*(Norm_sqr(F)-3)-mu*log(Det(F))+lambda/2*sqr(log(Det(F)))",
}
"""Strain energy [MPa] of each law, of the deformation gradient F."""

MIXED_LAWS = {"neo_hookean": "mu/2*(pow(Det(F),-2/3)*Norm_sqr(F)-3)+hydro*(Det(F)-1)-sqr(hydro)/(2*kappa)"}
"""The same with a hydrostatic stress ``hydro`` [MPa] as an unknown of its own; stationary, not least, in it."""

# Near its axis a shape is flat or round; 1e-18 mm^2 only keeps the root's derivative finite there.
_RADIUS = "sqrt(sqr(p(1))+sqr(p(2))+1e-18)"


def constants(material: Material) -> dict[str, float]:
    """Return the elastic constants by the names that `LAWS` use [MPa]."""
    mu, kappa = material.shear_modulus, material.bulk_modulus
    return {"mu": mu, "kappa": kappa, "lambda": kappa - 2 * mu / 3}


def shape(indenter: Indenter) -> tuple[list[tuple[str, str]], float] | None:
    """Return macros that end with ``core``, and the rounding [mm]; None for a shape without such a form."""
    q = indenter.parameters
    match indenter.shape:
        case "sphere":
            return [("core", f"(p-[0;0;{q[0]!r}])")], q[0]
        case "flat_punch":
            return [*_axial(f"pos_part(rho-{q[0] - q[1]!r})", f"(p(3)-{q[1]!r})")], q[1]
        case "ring":
            return [*_axial(f"(rho-{q[0]!r})", f"(p(3)-{q[1]!r})")], q[1]
        case "cone":
            return _cone(*q)
        case "cylinder":
            radius, length, edge = q
            section = f"sqrt(sqr(p(2))+sqr(p(3)-{radius!r})+1e-18)"
            return [
                ("over", _beyond("p(1)", length / 2 - edge)),
                ("section", section),
                ("out", f"(pos_part(section-{radius - edge!r})/section)"),
                ("core", f"[over;out*p(2);out*(p(3)-{radius!r})]"),
            ], edge
        case "square_punch":
            flat = q[0] / 2 - q[1]
            return [("core", f"[{_beyond('p(1)', flat)};{_beyond('p(2)', flat)};p(3)-{q[1]!r}]")], q[1]
        case "prism":
            return _prism(*q)
        case "ellipsoid":
            return _ellipsoid(*q)
    return None


def _axial(outward: str, upward: str) -> list[tuple[str, str]]:
    return [("rho", _RADIUS), ("out", f"({outward}/rho)"), ("core", f"[out*p(1);out*p(2);{upward}]")]


def _beyond(coordinate: str, half: float) -> str:
    """Return how far a coordinate is outside [-half, half], with its sign."""
    return f"(pos_part({coordinate}-{half!r})-pos_part(-{coordinate}-{half!r}))"


def _cone(angle: float, tip: float, radius: float) -> tuple[list[tuple[str, str]], float]:
    """Distance to the sharp cone's tip, or to its flank; the shoulder is left out."""
    c, s = float(np.cos(angle)), float(np.sin(angle))
    return [
        ("rho", _RADIUS),
        ("up", f"(p(3)-{tip!r})"),
        ("along", f"pos_part(rho*{s!r}+up*{c!r})"),
        ("out", f"(rho-along*{s!r})"),
        ("core", f"[out*p(1)/rho;out*p(2)/rho;up-along*{c!r}]"),
    ], tip


def _prism(angle: float, edge: float, length: float, half_width: float) -> tuple[list[tuple[str, str]], float]:
    """Distance to the sharp prism's lower edge, or to a flank; the shank is left out."""
    c, s = float(np.cos(angle)), float(np.sin(angle))
    return [
        ("over", _beyond("p(1)", length / 2 - edge)),
        ("rho", "sqrt(sqr(p(2))+1e-18)"),
        ("up", f"(p(3)-{edge!r})"),
        ("along", f"pos_part(rho*{s!r}+up*{c!r})"),
        ("out", f"(rho-along*{s!r})"),
        ("core", f"[over;out*p(2)/rho;up-along*{c!r}]"),
    ], edge


def _ellipsoid(a: float, b: float, c: float) -> tuple[list[tuple[str, str]], float]:
    """Distance to first order, f / |grad f| of f = |w| - 1: off by its own square times a curvature.

    The rounding of 1 mm only keeps the core from vanishing.
    """
    z = f"(p(3)-{c!r})"
    return [
        ("w", f"sqrt(sqr(p(1)/{a!r})+sqr(p(2)/{b!r})+sqr({z}/{c!r}))"),
        ("g", f"sqrt(sqr(p(1)/{a * a!r})+sqr(p(2)/{b * b!r})+sqr({z}/{c * c!r}))"),
        ("far", "((w-1)*w/g+1)/g"),
        ("core", f"[far*p(1)/{a * a!r};far*p(2)/{b * b!r};far*{z}/{c * c!r}]"),
    ], 1.0
