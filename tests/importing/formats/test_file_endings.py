"""Endings of files that are not read, with the way to one that is."""

import pytest
from sources import table, write

from tacdata.errors import UsageError
from tacdata.importing.formats.source_format import read_table


def test_a_text_that_is_named_xls_is_read(tmp_path):
    path = write(tmp_path, "csv", table()).rename(tmp_path / "run.xls")
    path.write_text(path.read_text().replace(",", "\t"))
    assert read_table(path).rows == len(table())


@pytest.mark.parametrize(
    ("name", "data", "remedy"), (("run.ODS", b"PK\x03\x04", "save it as .xlsx"), ("run.pkl", b"\x80\x04", "to_parquet"))
)
def test_the_way_to_a_file_that_is_read_is_named(tmp_path, name, data, remedy):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(UsageError) as error:
        read_table(tmp_path / name)
    assert remedy in error.value.remedy
