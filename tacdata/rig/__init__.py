"""The rig file: devices, pose of the sensor in the guide's frame, envelope of the guide."""

from tacdata.rig.rig import Envelope, Registration, Rig, read_rig, registration_for

__all__ = ["Envelope", "Registration", "Rig", "read_rig", "registration_for"]
