"""`tacdata`, where the packages of the recorder and of learning are missing; presses are bumps."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))  # the fast model lies there
MISSING = ("foxglove_schemas_protobuf", "mcap", "lerobot", "cv2", "serial", "matplotlib")


class Missing:
    """Finds none of the missing packages."""

    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in MISSING:
            raise ModuleNotFoundError(name)


class Skin:
    """Stands in for a specimen's skin model."""

    content_hash = "ab" * 32

    def __init__(self, sensor):
        self.sensor, self.identity = sensor, {}

    def solve_many(self, requests, capacity):
        from fast_model import path

        for number, one in enumerate(requests):
            yield number, path(self.sensor, one.depths, lambda d: d)


if __name__ == "__main__":
    sys.meta_path.insert(0, Missing())
    from tacdata import cli
    from tacdata.label_farm.simulated import solving

    solving.specimen_model = lambda simulation, number, device: Skin(simulation.specimens[number])
    cli.main()
