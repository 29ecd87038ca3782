"""Where the sensor lies in the guide's frame, found by touching it."""

from tacdata.registration.procedure import register
from tacdata.registration.result import Found, document_of
from tacdata.registration.settings import Settings

__all__ = ["Found", "Settings", "document_of", "register"]
