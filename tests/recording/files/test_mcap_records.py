"""Messages are those that mcap's own reader gives, chunked or not, and pictures need not be kept."""

from zlib import crc32

import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from tacdata.recording.files.mcap_records import read_records, walk

PICTURES = [bytes([k]) * (100 + k) for k in range(20)]


@pytest.fixture(params=[(True, CompressionType.ZSTD), (True, CompressionType.NONE), (False, CompressionType.NONE)])
def file(request, tmp_path):
    """Two channels between each other; a third begins late, in a chunk of its own."""
    chunked, compression = request.param
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=700, compression=compression, use_chunking=chunked)
        writer.start(profile="tacdata", library="test")
        schema = writer.register_schema("x", "protobuf", b"")
        numbers = {topic: writer.register_channel(topic, "protobuf", schema) for topic in ("/a", "/camera/b/image")}
        for k, picture in enumerate(PICTURES):
            writer.add_message(numbers["/a"], 10 + k, bytes([k, k]), 5 + k, k)
            image = CompressedImage(format="jpeg", data=picture).SerializeToString()
            writer.add_message(numbers["/camera/b/image"], 20 + k, image, 15 + k, 2**32 - 1 - k)
        late = writer.register_channel("/late", "protobuf", schema)
        writer.add_message(late, 2**63, b"", 1, 0)
        writer.finish()
    return path


def test_records_hold_what_mcap_reads(file):
    records, damage = read_records(file), []
    for topic in ("/a", "/camera/b/image", "/late"):
        with file.open("rb") as stream:
            theirs = [m for _, _, m in make_reader(stream).iter_messages(topics=[topic])]
        assert records.of_topic(topic) == theirs
        column = records.columns_of(topic)
        assert column.data == [m.data for m in theirs]
        assert column.sequence.tolist() == [m.sequence for m in theirs]
    assert records.damage == []
    assert [r for r in walk(file, damage) if type(r).__name__ == "Message"] == records.messages
    assert records.columns_of("/nothing").data == []


def test_pictures_are_replaced_by_their_digest_or_by_nothing_and_may_be_looked_at(file):
    digests = [crc32(picture).to_bytes(4, "little") for picture in PICTURES]
    assert read_records(file, images=False).columns_of("/camera/b/image").data == digests
    looked = []
    records = read_records(file, images=False, digests=False, seen=lambda t, m: looked.append((t, bytes(m))))
    assert records.columns_of("/camera/b/image").data == [b""] * len(PICTURES)
    assert [CompressedImage.FromString(m).data for _, m in looked] == PICTURES
    assert {topic for topic, _ in looked} == {"/camera/b/image"}
    assert records.columns_of("/a").data == [bytes([k, k]) for k in range(len(PICTURES))]
