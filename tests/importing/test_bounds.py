"""Small files that grow when they are read, and sources that are no files: refused in words, within the memory."""

import json
import os

import numpy as np
import pytest

from tacdata.documents import content_of
from tacdata.errors import FormatError, UsageError
from tacdata.importing.formats.source_format import read_table
from tacdata.importing.proposing.description import described

ROWS = 40_000_000


def _npz(path):
    np.savez_compressed(path, t=np.zeros(ROWS))


def _mat(path):
    from scipy.io import savemat

    savemat(path, {"t": np.zeros(ROWS)}, do_compression=True)


def _parquet(path):
    import pyarrow as pa
    from pyarrow import parquet

    parquet.write_table(pa.table({"t": np.zeros(ROWS)}), path, compression="zstd")


def _zarr(path):
    (path / "t").mkdir(parents=True)
    described = {"zarr_format": 2, "shape": [10**12], "chunks": [10**6], "dtype": "<f8", "compressor": None}
    described |= {"fill_value": 0.0, "order": "C", "filters": None}
    (path / "t" / ".zarray").write_text(json.dumps(described))


@pytest.mark.parametrize("write", (_npz, _mat, _parquet, _zarr))
def test_a_small_file_that_fills_the_memory_is_refused(tmp_path, write):
    path = tmp_path / f"run.{write.__name__[1:]}"
    write(path)
    with pytest.raises(FormatError, match=r"grows to .* MB when it is read"):
        read_table(path)


def test_a_workbook_that_grows_is_refused(tmp_path):
    import zipfile

    import openpyxl

    path = tmp_path / "run.xlsx"
    book = openpyxl.Workbook()
    book.active.append([1.0, 2.0])
    book.save(path)
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/worksheets/sheet2.xml", b"<c><v>1</v></c>" * 3_000_000)
    with pytest.raises(FormatError, match="grows to 45 MB"):
        read_table(path)


def test_an_archive_of_true_readings_is_read_however_large(tmp_path):
    path = tmp_path / "run.npz"
    np.savez_compressed(path, t=np.arange(1000.0), c0=np.random.default_rng(0).normal(size=1000))
    assert read_table(path).rows == 1000


@pytest.mark.parametrize("text", ("a: &a [*a]", "a: &a {b: *a}", "a: &a\n  - b: [*a]"))
def test_a_document_inside_itself_is_refused(tmp_path, text):
    path = tmp_path / "mapping.yaml"
    path.write_text(text)
    with pytest.raises(FormatError, match=r"line [12] contains itself by an alias"):
        content_of(path, "import_mapping")


@pytest.mark.parametrize("form", ("[{0},{0},{0},{0},{0},{0},{0},{0},{0},{0}]", "{{x: {0}, y: {0}, <<: {0}, z: {0}}}"))
def test_aliases_inside_aliases_are_refused(tmp_path, form):
    lines = ["a0: &a0 {k: 1}", *(f"a{k + 1}: &a{k + 1} " + form.format(f"*a{k}") for k in range(12))]
    path = tmp_path / "mapping.yaml"
    path.write_text("\n".join(lines))
    with pytest.raises(FormatError, match=r"with its aliases the document has .* values"):
        content_of(path, "import_mapping")


def test_plain_aliases_are_read(tmp_path):
    path = tmp_path / "mapping.yaml"
    path.write_text("a: &a {k: 1, l: [2]}\nb: *a\nc: {<<: *a, k: 3}\n")
    assert content_of(path, "import_mapping")["c"] == {"k": 3, "l": [2]}


def test_a_pipe_is_no_source(tmp_path):
    os.mkfifo(tmp_path / "run.csv")
    with pytest.raises(UsageError, match="is a pipe or a device"):
        described(tmp_path / "run.csv")
    with pytest.raises(UsageError, match="it is empty"):
        described(tmp_path)
