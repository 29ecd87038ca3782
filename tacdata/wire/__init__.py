"""Decodes the serial lines: a board's frames, and GRBL's answers."""

from tacdata.wire.frames.decoder import Decoder
from tacdata.wire.frames.encoder import Encoder
from tacdata.wire.frames.frame_format import FrameFormat, default_format, read_format

__all__ = ["Decoder", "Encoder", "FrameFormat", "default_format", "read_format"]
