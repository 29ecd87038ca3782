"""What goes over the serial lines: a board's frames as data, and GRBL's answers and codes."""

from tacdata.wire.decoder import Decoder
from tacdata.wire.encoder import Encoder
from tacdata.wire.frame_format import FrameFormat, default_format, read_format

__all__ = ["Decoder", "Encoder", "FrameFormat", "default_format", "read_format"]
