"""Describe a taxel skin of your own by a file, and show the interpreted sensor."""

from pathlib import Path

import tacdata as td

sensor = td.read_sensor(Path(__file__).with_name("own_sensor.yaml"))
material = sensor.material
print(f"{sensor.name}: {sensor.taxels.count} taxels, a map of {sensor.map.shape} pixels")
print(f"shear modulus {material.shear_modulus:.4f} MPa, bulk modulus {material.bulk_modulus:.4f} MPa")
print(f"first taxel at x, y = {sensor.taxels.centers[0]} mm")
assert abs(material.bulk_modulus - 1.25) < 1e-12
