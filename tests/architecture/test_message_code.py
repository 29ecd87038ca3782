"""The generated message code is that of the message files."""

import importlib
import subprocess
import sys
from pathlib import Path

import pytest
from google.protobuf import descriptor_pb2

from tacdata import schemas

FOLDER = Path(schemas.__file__).parent
MESSAGES = sorted(FOLDER.glob("*.proto"))


@pytest.mark.parametrize("path", MESSAGES, ids=lambda p: p.name)
def test_the_generated_code_is_up_to_date(path, tmp_path):
    target = tmp_path / "descriptor"
    compiler = [sys.executable, "-m", "grpc_tools.protoc"]
    subprocess.run([*compiler, f"-I{FOLDER}", f"--descriptor_set_out={target}", str(path)], check=True)
    (fresh,) = descriptor_pb2.FileDescriptorSet.FromString(target.read_bytes()).file
    module = importlib.import_module(f"schemas.{path.stem}_pb2")
    standing = descriptor_pb2.FileDescriptorProto.FromString(module.DESCRIPTOR.serialized_pb)
    # Names of JSON fields are filled in by one path and not by the other.
    for message in (*fresh.message_type, *standing.message_type):
        for field in message.field:
            field.ClearField("json_name")
    assert fresh == standing
