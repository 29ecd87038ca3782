"""The label file: exact round trip, refusals in words, nothing half written."""

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from tacdata import provenance, schemas
from tacdata.errors import FormatError, UsageError
from tacdata.labels import Label, columns, read_label, table, write_label

ARRAYS = tuple(columns.ALL)


def example(frames: int = 7, **changes) -> Label:
    random = np.random.default_rng(3)
    values = {
        "episode": 4,
        "time_ns": 1_700_000_000_000_000_000 + np.arange(frames) * 33_333_333,
        "tip": random.normal(size=(frames, 3)),
        "signed": random.normal(size=(frames, 35, 26)).astype(np.float32),
        "taxel_force": random.normal(size=(frames, 24)).astype(np.float32),
        "taxel_closure": random.normal(size=(frames, 24)).astype(np.float32),
        "taxel_area": random.random((frames, 24)).astype(np.float32),
        "force": random.normal(size=(frames, 3)).astype(np.float32),
        "error_map": (0.1 * random.random((frames, 35, 26))).astype(np.float16),
        "error": random.random(frames).astype(np.float32),
        "force_error": random.random(frames).astype(np.float32),
        "provenance": provenance.stamp("test", {"sensor": "a" * 64, "recording": "b" * 64}, {"mesh": 0.4}),
    }
    return Label(**{**values, **changes})


def whole(frames: int = 7, **changes) -> Label:
    """The same with everything that a label may know."""
    random = np.random.default_rng(4)
    known = {
        name: random.random(quantity.shape(frames, (35, 26), 24)).astype(quantity.dtype)
        for name, quantity in columns.OPTIONAL.items()
    }
    return example(frames, **{**known, **changes})


def test_round_trip_is_exact(tmp_path: Path) -> None:
    label = whole(
        signed=np.nextafter(np.float32(0.1), np.float32(1), dtype=np.float32) * np.ones((7, 35, 26), np.float32)
    )
    write_label(tmp_path / "a" / "label.parquet", label)
    back = read_label(tmp_path / "a" / "label.parquet")
    for name in ARRAYS:
        assert getattr(back, name).dtype == getattr(label, name).dtype
        assert np.array_equal(getattr(back, name), getattr(label, name))
    assert back.provenance == label.provenance
    assert back.episode == 4
    assert back.depth.min() >= 0
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["label.parquet"]


def test_a_label_that_knows_no_more_has_no_column_for_it(tmp_path: Path) -> None:
    write_label(tmp_path / "l.parquet", example(taxel_counts=np.ones((7, 24), np.float32)))
    back = read_label(tmp_path / "l.parquet")
    assert back.uncertainty is None and back.taxel_counts is not None and back.taxel_counts.sum() == 7 * 24
    assert set(pq.read_schema(tmp_path / "l.parquet").names) == {*columns.REQUIRED, "taxel_counts"}


def test_a_label_of_format_2_0_is_still_read(tmp_path: Path) -> None:
    path = tmp_path / "l.parquet"
    write_label(path, example())
    content = pq.read_table(path)
    header = json.loads(content.schema.metadata[table.HEADER])
    header["version"] = "2.0"
    pq.write_table(content.replace_schema_metadata({table.HEADER: json.dumps(header)}), path)
    assert read_label(path).interpolation_error is None


def test_header_says_units_and_is_checked(tmp_path: Path) -> None:
    write_label(tmp_path / "l.parquet", example())
    header = json.loads(pq.read_schema(tmp_path / "l.parquet").metadata[table.HEADER])
    assert header["units"]["signed"] == "mm"
    assert header["version"] == schemas.version("label")


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"signed": np.full((7, 35, 26), np.nan, np.float32)}, "not finite"),
        ({"force": np.zeros((6, 3), np.float32)}, "label.force"),
        ({"tip": np.zeros((7, 2))}, "three columns"),
        ({"time_ns": np.zeros(7, np.int64)}, "does not increase"),
        ({"error_map": np.full((7, 35, 25), 0.01, np.float16)}, "one error a pixel"),
        ({"taxel_area": np.zeros((7, 23), np.float32)}, "same number of taxels"),
        ({"force_error": np.zeros((7, 1), np.float32)}, "label.force_error"),
        ({"uncertainty": np.full((7, 35, 26), np.inf, np.float16)}, "uncertainty holds values that are not finite"),
        ({"uncertainty": np.zeros((7, 26, 35), np.float16)}, "one error a pixel"),
        ({"taxel_counts": np.zeros((7, 23), np.float32)}, "same number of taxels"),
        ({"interpolation_error": np.zeros((6,), np.float32)}, "label.interpolation_error"),
        ({"provenance": {"made_by": "hand"}}, "code_version"),
    ],
)
def test_a_bad_label_is_refused_and_the_old_file_kept(tmp_path: Path, changes: dict, word: str) -> None:
    path = tmp_path / "l.parquet"
    write_label(path, example())
    before = path.read_bytes()
    with pytest.raises(FormatError, match=word):
        write_label(path, example(**changes))
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no label file"):
        read_label(tmp_path / "none.parquet")


def test_damaged_and_foreign_files(tmp_path: Path) -> None:
    path = tmp_path / "l.parquet"
    write_label(path, example())
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(FormatError, match="damaged"):
        read_label(path)
    flipped = bytearray(content)
    flipped[len(content) // 2] ^= 0xFF
    path.write_bytes(bytes(flipped))
    with pytest.raises(FormatError, match="damaged"):
        read_label(path)
    pq.write_table(pq.read_table(_saved(path, content)).replace_schema_metadata({}), path)
    with pytest.raises(FormatError, match=r"no key tacdata\.label"):
        read_label(path)


def test_another_major_version(tmp_path: Path) -> None:
    path = tmp_path / "l.parquet"
    write_label(path, example())
    content = pq.read_table(path)
    header = json.loads(content.schema.metadata[table.HEADER])
    header["version"] = "9.0"
    pq.write_table(content.replace_schema_metadata({table.HEADER: json.dumps(header)}), path)
    with pytest.raises(table.LabelVersionError, match=r"version 9\.0"):
        read_label(path)


def test_a_label_of_the_first_format_is_refused_in_words(tmp_path: Path) -> None:
    path = tmp_path / "l.parquet"
    write_label(path, example())
    content = pq.read_table(path)
    header = json.loads(content.schema.metadata[table.HEADER])
    header["version"] = "1.0"
    for name in ("error_map", "force_error", "taxel_area", "taxel_closure"):
        del header["units"][name]
        content = content.drop_columns([name])
    pq.write_table(content.replace_schema_metadata({table.HEADER: json.dumps(header)}), path)
    with pytest.raises(FormatError, match=r"label format version 1\.0") as refusal:
        read_label(path)
    assert "--redo" in refusal.value.remedy and schemas.version("label") in refusal.value.allowed


def test_a_pixels_error_costs_two_bytes_and_keeps_three_digits(tmp_path: Path) -> None:
    given = np.geomspace(1e-4, 1.0, 7 * 35 * 26).reshape(7, 35, 26)
    write_label(tmp_path / "l.parquet", example(error_map=given.astype(np.float16)))
    assert pq.read_schema(tmp_path / "l.parquet").field("error_map").type.value_type == "halffloat"
    back = read_label(tmp_path / "l.parquet").error_map
    np.testing.assert_allclose(back.astype(float), given, rtol=6e-4)


def test_header_and_columns_must_agree(tmp_path: Path) -> None:
    path = tmp_path / "l.parquet"
    write_label(path, example())
    content = pq.read_table(path)
    pq.write_table(content.slice(0, 3), path)
    with pytest.raises(FormatError, match="3 rows"):
        read_label(path)
    pq.write_table(content.drop_columns(["error"]), path)
    with pytest.raises(FormatError, match="rows of"):
        read_label(path)


def _saved(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path
