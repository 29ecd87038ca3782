"""pyserial asks for this file by the scheme of a port's name: sim://..."""

from simulated_line import serial_class_for_url

__all__ = ["serial_class_for_url"]
