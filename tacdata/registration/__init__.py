"""Where the sensor lies in the guide's frame, found by touching it."""

from tacdata.registration.procedure import Settings, register
from tacdata.registration.result import Found, document_of

__all__ = ["Found", "Settings", "document_of", "register"]
