"""The version of a model that is kept from an earlier process: it is that of what is there now, or is asked again."""

from dataclasses import replace

import pytest

from tacdata.errors import SolveError
from tacdata.label_farm.presses import model
from tacdata.label_farm.presses.model import FACTORY, Version
from tacdata.sensor import default_sensor

SENSOR = default_sensor()


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """Sensors whose version was asked of a process, with an empty cache."""
    sensors = []

    def found(factory, sensor):
        sensors.append(sensor)
        return Version(f"version {len(sensors)}", ("unstable above 1.8",))

    monkeypatch.setenv("TACDATA_CACHE", str(tmp_path))
    monkeypatch.setattr(model, "_found", found)
    return sensors


def test_a_second_run_starts_no_process(asked):
    assert model.version(FACTORY, SENSOR) == model.version(FACTORY, SENSOR)
    assert model.version(FACTORY, SENSOR) == Version("version 1", ("unstable above 1.8",))
    assert len(asked) == 1


def test_another_skin_other_spreads_and_another_model_are_asked_for(asked):
    model.version(FACTORY, SENSOR)
    softer = replace(SENSOR, material=replace(SENSOR.material, youngs_modulus=0.41))
    assert model.version(FACTORY, softer).content_hash == "version 2"
    assert model.version(FACTORY, replace(SENSOR, uncertainty={})).content_hash == "version 3"
    for _ in range(2):
        model.version("fast_model:FastModel", SENSOR)
    assert len(asked) == 5


def test_a_mesh_that_is_made_again_is_another_model(asked, tmp_path):
    mesh = tmp_path / "meshes" / "0123.npz"
    mesh.parent.mkdir()
    mesh.write_bytes(b"one mesh")
    assert model.version(FACTORY, SENSOR) == model.version(FACTORY, SENSOR)
    mesh.write_bytes(b"a mesh of another size")
    assert model.version(FACTORY, SENSOR).content_hash == "version 2"


@pytest.mark.parametrize("damage", [b"", b"half a checks", b"\xff\xfe", b'"not a version"'])
def test_a_damaged_entry_is_asked_for_again_and_mended(asked, tmp_path, damage):
    model.version(FACTORY, SENSOR)
    [entry] = (tmp_path / "results" / "versions").iterdir()
    whole = entry.read_bytes()
    entry.write_bytes(damage)
    assert model.version(FACTORY, SENSOR).content_hash == "version 2"
    assert model.version(FACTORY, SENSOR).content_hash == "version 2"
    entry.write_bytes(whole.replace(b"version 1", b"version 7"))
    assert model.version(FACTORY, SENSOR).content_hash == "version 3"


def test_a_cache_that_cannot_be_written_costs_time_alone(asked, tmp_path, monkeypatch):
    (tmp_path / "a file").touch()
    monkeypatch.setenv("TACDATA_CACHE", str(tmp_path / "a file"))
    assert [model.version(FACTORY, SENSOR).content_hash for _ in range(2)] == ["version 1", "version 2"]


def test_a_sensor_that_cannot_be_modelled_is_refused_every_time(tmp_path, monkeypatch):
    def refused(factory, sensor):
        raise SolveError("no bonded face holds the skin", "sides or bottom bonded", "set contact/bonded")

    monkeypatch.setenv("TACDATA_CACHE", str(tmp_path))
    monkeypatch.setattr(model, "_found", refused)
    for _ in range(2):
        with pytest.raises(SolveError, match="no bonded face"):
            model.version(FACTORY, SENSOR)
