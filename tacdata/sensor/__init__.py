"""The sensor description: one versioned file says everything about a taxel skin."""

from tacdata.sensor.sensor import Contact, DepthMap, Material, Sensor, Skin, Taxels, default_sensor, read_sensor

__all__ = ["Contact", "DepthMap", "Material", "Sensor", "Skin", "Taxels", "default_sensor", "read_sensor"]
