"""Listing shows every member with its parameters and imports none of them."""

import subprocess
import sys

import pytest

from tacdata import catalogue, registry
from tacdata.errors import UsageError


def test_every_folder_of_members_is_found():
    found = catalogue.registries()
    assert {"verbs", "devices", "indenters"} <= set(found)
    assert found["indenters"].room == "tacdata.indenters"
    assert found["indenters"].base == "indenter"
    assert all(r.meaning for r in found.values())


@pytest.mark.parametrize("name", sorted(catalogue.registries()))
def test_members_are_those_of_the_registry_and_say_what_they_are(name):
    entry = catalogue.registries()[name]
    shown = catalogue.members(name)
    assert [m.name for m in shown] == registry.names(entry.room, entry.base)
    assert all(m.meaning for m in shown)


def test_parameters_come_with_their_units():
    sphere = next(m for m in catalogue.members("indenters") if m.name == "sphere")
    assert sphere.parameters == (("radius", "Radius [mm]."),)


@pytest.mark.parametrize("member", catalogue.members("indenters"), ids=lambda m: m.name)
def test_every_indenter_parameter_names_its_unit(member):
    assert member.parameters
    # The file of a solid, and its hash, are texts.
    assert all("[" in meaning for name, meaning in member.parameters if name not in ("file", "sha256"))


def test_a_wrong_name_is_answered_with_a_right_one():
    with pytest.raises(UsageError, match="did you mean 'indenters'"):
        catalogue.members("indenter")


def test_listing_imports_no_member():
    code = "import sys; from tacdata import catalogue; catalogue.members('indenters'); print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "tacdata.catalogue" in loaded
    assert "tacdata.indenters.sphere" not in loaded
