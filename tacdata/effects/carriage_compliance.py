"""The frame gives way under load, between the motors and the tag."""

from __future__ import annotations

from tacdata.chain import Course, Response
from tacdata.effects.effect import Effect, Family, Parameter
from tacdata.effects.frame_compliance import given_way

__all__ = ["CarriageCompliance"]


class CarriageCompliance(Effect):
    """The frame gives way under load, between the motors and the tag."""

    title = "The frame gives way under load, and the tag with it"
    catalogue = ("K10",)
    stage = "kinematics"
    moves = ("tag", "label", "signal", "force")
    group = "depth curvature"
    family = Family.KINEMATICS
    equation = "d = z - c F(d) / max F(d), by fixed-point steps; seen by the tag"
    source = "Oliver & Pharr, J. Mater. Res. 7 (1992) 1564: h = z - F C_f"
    experiment = "press a rigid block while the tag is in view"
    parameters = (Parameter("c", "mm per largest force", "deflection at the largest force", 0.05, 0.0, 2.0),)
    seen_by_tag = True
    mechanism = "frame_compliance"

    apply = given_way

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "no tag was seen" if course.tag is None else ""
