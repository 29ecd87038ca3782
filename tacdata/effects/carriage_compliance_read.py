"""The frame gives way under load, between the motors and the tag, beside readings that are not linear in force."""

from __future__ import annotations

from tacdata.chain import Course, Response
from tacdata.effects.carriage_compliance import CarriageCompliance
from tacdata.effects.effect import Parameter
from tacdata.effects.relaxation_read import POWER


class CarriageComplianceRead(CarriageCompliance):
    """The frame gives way under load, between the motors and the tag, beside readings that are not linear in force."""

    title = "The frame gives way under load, and the tag with it"
    equation = "d = z - c (r(d) / max r(d))^(1/m), r the root mean square of the readings; seen by the tag"
    parameters = (Parameter("c", "mm per largest force", "deflection at the largest force", 0.05, 0.0, 2.0), POWER)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return super().unjudgeable(course, response) or ("the force is known" if course.force is not None else "")
