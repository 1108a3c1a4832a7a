"""Reads what `dtactctl record` wrote: the MCAP container (https://mcap.dev/spec), of which the
frames and events are taken."""
from __future__ import annotations

import struct
import warnings
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
#: JPEGs that wait for their frame: other writers put more than one between them.
_WAITING_JPEGS = 8
_FRAMES, _EVENTS, _JPEGS = "/dtact/frame", "/dtact/event", "/camera/jpeg"


@dataclass
class _State:
    """What earlier records of the file say about the ones to come, and what could not be read."""

    topics: dict[int, str] = field(default_factory=dict)
    #: Bytes of the newest JPEGs by log time: they stand before the frames that they belong to.
    jpegs: dict[int, bytes] = field(default_factory=dict)
    chunks: int = 0
    messages: int = 0
    #: Why the first of them could not be read.
    first: str = ""
    #: Why the file ends too early; empty where it does not.
    end: str = ""

    def damage(self) -> str:
        """Empty when all was read."""
        lost = [f"{count} {what}(s) cannot be read" for count, what
                in ((self.chunks, "chunk"), (self.messages, "message")) if count]
        if lost:
            lost[-1] += f" (the first: {self.first})"
        return "; ".join(lost + [self.end] * bool(self.end))


_DAMAGE = (struct.error, ValueError, DecodeError, zstandard.ZstdError)


def read(path: str | Path) -> Iterator[Frame | Event]:
    """The frames, with their JPEGs, and events of a recording, in the order of the file. What of it
    cannot be read is passed over, and a RuntimeWarning at the end says how much and why; so is
    a file whose writer was killed. Error for a file that is no MCAP, or of which nothing can be
    read."""
    with open(path, "rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise Error(f"{path} is no MCAP file")
        state = _State()
        any_read = False
        for opcode, body in _records(file, state):
            whole = [(opcode, memoryview(body))]
            for inner, part in _in_chunk(body, state) if opcode == _CHUNK else whole:
                item = _taken(inner, part, state)
                if item is not None:
                    any_read = True
                    yield item
    if damage := state.damage():
        if not any_read and (state.chunks or state.messages or state.end != _CUT):
            raise Error(f"{path} is damaged: {damage}")
        warnings.warn(f"{path}: {damage}", RuntimeWarning, stacklevel=2)


_CUT = "the file ends without its end mark: its writer was killed, or it was cut off"


def _records(file: IO[bytes], state: _State) -> Iterator[tuple[int, bytes]]:
    """Up to the magic at the end, or where the file was cut off or a record is no record."""
    while len(head := file.read(9)) == 9:
        opcode, size = struct.unpack("<BQ", head)
        if size > _MAX_RECORD:
            state.end = f"a record of {size} bytes, at most {_MAX_RECORD} are read"
            return
        body = file.read(size)
        if len(body) < size:
            state.end = _CUT
            return
        yield opcode, body
    if head != _MAGIC:
        state.end = _CUT


def _in_chunk(body: bytes, state: _State) -> Iterator[tuple[int, memoryview]]:
    """Its records, of a damaged one those before the damage."""
    try:
        size, name_size = struct.unpack_from("<16xQ4xI", body)
        at = 32 + name_size
        compression = body[32:at].decode()
        (packed_size,) = struct.unpack_from("<Q", body, at)
        packed = body[at + 8 : at + 8 + packed_size]
        if size > _MAX_RECORD:
            raise ValueError(f"a chunk of {size} bytes")
        if compression == "zstd":
            # What the frame says itself is allocated, whatever max_output_size is.
            if zstandard.frame_content_size(packed) > size:
                raise ValueError("a chunk has another size than it says")
            packed = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
        elif compression:
            raise ValueError(f"its chunks are compressed with {compression}, not zstd")
        if len(packed) != size:
            raise ValueError("a chunk has another size than it says")
        records = memoryview(packed)
        while records:
            opcode, length = struct.unpack_from("<BQ", records)
            if length > len(records) - 9:
                raise ValueError("a record reaches beyond its chunk")
            yield opcode, records[9 : 9 + length]
            records = records[9 + length :]
    except _DAMAGE as e:
        state.first = state.first or str(e)
        state.chunks += 1


def _taken(opcode: int, body: bytes | memoryview, state: _State) -> Frame | Event | None:
    try:
        return _take(opcode, body, state)
    except _DAMAGE as e:
        state.first = state.first or str(e)
        state.messages += 1
        return None


def _take(opcode: int, body: bytes | memoryview, state: _State) -> Frame | Event | None:
    if opcode == _CHANNEL:
        number, size = struct.unpack_from("<H2xI", body)
        state.topics[number] = bytes(body[8 : 8 + size]).decode()
    elif opcode == _MESSAGE:
        channel, log_time = struct.unpack_from("<H4xQ8x", body)
        if channel not in state.topics:
            raise ValueError(f"a message of channel {channel}, which is not in the file")
        topic = state.topics[channel]
        data = bytes(body[22:])
        if topic == _FRAMES:
            frame = message_class("Frame").FromString(data)
            if log_time in state.jpegs:
                frame.jpeg.data = state.jpegs.pop(log_time)
            return Frame(frame)
        if topic == _JPEGS:
            state.jpegs[log_time] = COMPRESSED_IMAGE.FromString(data).data
            if len(state.jpegs) > _WAITING_JPEGS:
                del state.jpegs[min(state.jpegs)]
        elif topic == _EVENTS:
            return event_of(message_class("Event").FromString(data))
    return None
