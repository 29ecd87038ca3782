"""A file of solved presses gives back what was put in, to its resolution, or says that it is damaged."""

import numpy as np
import pytest
from fast_model import path

from tacdata.errors import FormatError
from tacdata.label_farm.simulated.shard import GRAIN, Shard, read_about, read_shard, shard_files
from tacdata.sensor import default_sensor

SENSOR = default_sensor()
DEPTHS = {3: (0.0, 0.4, 0.0), 7: (0.0, 0.3, 0.9, 0.3, 0.0)}
IDENTITY = {"model": "ab" * 32}


def written(folder, scale=1.0):
    solutions = {n: path(SENSOR, depths, lambda d: scale * d, 0.1 * n, numerical=0.01) for n, depths in DEPTHS.items()}
    return solutions, Shard(solutions, {5: "no equilibrium"}, IDENTITY).write(folder)


@pytest.mark.parametrize("scale", [1.0, 12.0])
def test_solutions_come_back_to_the_resolution_of_the_file_however_deep(tmp_path, scale):
    solutions, file = written(tmp_path, scale)
    found = read_shard(file)
    assert (list(found.solutions), found.failed, found.numbers) == ([3, 7], {5: "no equilibrium"}, [3, 5, 7])
    for number, given in solutions.items():
        own = found.solutions[number]
        assert np.array_equal(own.depth, given.depth)
        assert np.abs(own.surface - given.surface).max() <= GRAIN / 2 + 1e-12
        assert np.abs(own.numerical - given.numerical).max() <= GRAIN / 2 + 1e-12
        np.testing.assert_allclose(own.taxel_force, given.taxel_force, rtol=1e-6)
        assert own.provenance["parents"] == IDENTITY


def test_what_a_file_settles_is_known_without_its_arrays(tmp_path):
    _, file = written(tmp_path)
    (tmp_path / "presses-notes.npz").write_text("no file of presses")
    assert shard_files(tmp_path) == [file]
    assert (read_about(file).numbers, read_about(file).identity) == ([3, 5, 7], IDENTITY)


@pytest.mark.parametrize("read", [read_shard, read_about])
@pytest.mark.parametrize("left", [0, 100, -40])
def test_a_damaged_file_is_named(tmp_path, read, left):
    _, file = written(tmp_path)
    file.write_bytes(file.read_bytes()[:left])
    with pytest.raises(FormatError, match="is damaged"):
        read(file)
