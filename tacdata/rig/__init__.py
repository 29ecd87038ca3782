"""The rig: which devices, how the sensor lies in the guide's frame, where the guide may go."""

from tacdata.rig.rig import Envelope, Registration, Rig, read_rig, registration_for

__all__ = ["Envelope", "Registration", "Rig", "read_rig", "registration_for"]
