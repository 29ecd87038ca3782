"""Registration: finds the sensor's pose in the guide's frame, by touching it."""

from tacdata.registration.procedure import register
from tacdata.registration.result import Found, document_of
from tacdata.registration.settings import RegistrationSettings

__all__ = ["Found", "RegistrationSettings", "document_of", "register"]
