"""Every format of foreign files keeps the promises of its base class."""

import pytest

from tacdata import registry
from tacdata.errors import FormatError, UsageError
from tacdata.importing.formats.source_format import BASE, ROOM, SourceFormat, read_table, tables_in

NAMES = registry.names(ROOM, BASE)
KINDS = {name: registry.load(ROOM, BASE, name, SourceFormat) for name in NAMES}
ENDINGS = [(name, ending) for name in NAMES for ending in KINDS[name].endings]
NOISE = bytes(range(0, 256, 3)) * 40


def test_an_ending_belongs_to_one_format():
    endings = [ending for _, ending in ENDINGS]
    assert len(endings) == len(set(endings))
    assert all(ending.startswith(".") and ending == ending.lower() for ending in endings)


@pytest.mark.parametrize("name", NAMES)
def test_a_format_is_explained_and_has_an_ending(name):
    assert KINDS[name].endings
    assert KINDS[name].__doc__


@pytest.mark.parametrize("content", [b"", NOISE], ids=["empty", "noise"])
@pytest.mark.parametrize(("name", "ending"), ENDINGS)
def test_a_file_that_is_none_of_its_kind_is_refused_in_words(name, ending, content, tmp_path):
    path = tmp_path / f"rows{ending}"
    path.write_bytes(content)
    with pytest.raises(FormatError) as caught:
        read_table(path)
    assert path.name in str(caught.value)
    assert caught.value.allowed
    assert caught.value.remedy


@pytest.mark.parametrize("name", NAMES)
def test_a_missing_file_is_refused_in_words(name, tmp_path):
    path = tmp_path / f"nothing{KINDS[name].endings[0]}"
    for attempt in (lambda: read_table(path), lambda: tables_in(path)):
        with pytest.raises(UsageError, match="no file"):
            attempt()
