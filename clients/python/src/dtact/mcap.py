"""Reads what `dtactctl record` wrote: the MCAP container (https://mcap.dev/spec), of which the
frames and events are taken."""
from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

import zstandard
from google.protobuf.message import DecodeError

from .errors import Error
from .event import Event, event_of
from .frame import Frame
from .messages import COMPRESSED_IMAGE, message_class

_MAGIC = b"\x89MCAP0\r\n"
_CHANNEL, _MESSAGE, _CHUNK = 0x04, 0x05, 0x06
# Maximum bytes of a record, and of a decompressed chunk, in files of dtactctl.
_MAX_RECORD = 256 << 20
_FRAMES, _EVENTS, _JPEGS = "/dtact/frame", "/dtact/event", "/camera/jpeg"


@dataclass
class _State:
    """What earlier records of the file say about the ones to come."""

    topics: dict[int, str] = field(default_factory=dict)
    #: Log time and bytes of the newest JPEG: it stands before the frame that it belongs to.
    jpeg: tuple[int, bytes] | None = None


def read(path: str | Path) -> Iterator[Frame | Event]:
    """The frames, with their JPEGs, and events of a recording, in the order of the file. One whose writer was killed is
    read as far as it goes. Error for a file that is no MCAP, or is damaged inside."""
    with open(path, "rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise Error(f"{path} is no MCAP file")
        state = _State()
        try:
            for opcode, body in _records(file):
                if opcode == _CHUNK:
                    for inner, part in _in_chunk(body):
                        yield from _take(inner, part, state)
                else:
                    yield from _take(opcode, body, state)
        except (struct.error, ValueError, DecodeError, zstandard.ZstdError) as e:
            raise Error(f"{path} is damaged: {e}") from e


def _records(file: IO[bytes]) -> Iterator[tuple[int, bytes]]:
    """Up to the magic at the end, or where the file was cut off."""
    while len(head := file.read(9)) == 9:
        opcode, size = struct.unpack("<BQ", head)
        if size > _MAX_RECORD:
            raise ValueError(f"a record of {size} bytes")
        body = file.read(size)
        if len(body) < size:
            return
        yield opcode, body


def _in_chunk(body: bytes) -> Iterator[tuple[int, memoryview]]:
    size, name_size = struct.unpack_from("<16xQ4xI", body)
    at = 32 + name_size
    compression = body[32:at].decode()
    (packed_size,) = struct.unpack_from("<Q", body, at)
    packed = body[at + 8 : at + 8 + packed_size]
    if size > _MAX_RECORD:
        raise ValueError(f"a chunk of {size} bytes")
    if compression == "zstd":
        packed = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
    elif compression:
        raise ValueError(f"its chunks are compressed with {compression}, not zstd")
    if len(packed) != size:
        raise ValueError("a chunk has another size than it says")
    records = memoryview(packed)
    while records:
        opcode, length = struct.unpack_from("<BQ", records)
        yield opcode, records[9 : 9 + length]
        records = records[9 + length :]


def _take(opcode: int, body: bytes | memoryview, state: _State) -> Iterator[Frame | Event]:
    if opcode == _CHANNEL:
        number, size = struct.unpack_from("<H2xI", body)
        state.topics[number] = bytes(body[8 : 8 + size]).decode()
    elif opcode == _MESSAGE:
        channel, log_time = struct.unpack_from("<H4xQ", body)
        topic = state.topics.get(channel)
        if topic not in (_FRAMES, _EVENTS, _JPEGS):
            return
        data = bytes(body[22:])
        if topic == _FRAMES:
            frame = message_class("Frame").FromString(data)
            if state.jpeg is not None and state.jpeg[0] == log_time:
                frame.jpeg.data = state.jpeg[1]
                state.jpeg = None
            yield Frame(frame)
        elif topic == _JPEGS:
            state.jpeg = log_time, COMPRESSED_IMAGE.FromString(data).data
        else:
            event = event_of(message_class("Event").FromString(data))
            if event is not None:
                yield event
