"""The pixels in the bytes of a DepthMap: proto/README.md says what they are, byte for byte."""
from __future__ import annotations

from typing import Callable

import numpy as np
import zstandard
from numpy.typing import NDArray

from .errors import ProtocolError
from .messages import Message, value_of

# The largest map of a daemon: what a message can hold as int16.
_MAX_PIXELS = (16 << 20) // 2


def _unpack(data: bytes, least: int, most: int) -> bytes:
    """What is in a zstd frame, `least` … `most` bytes. What the frame says of itself comes first,
    so that a short message cannot make us allocate much."""
    if not least <= zstandard.frame_content_size(data) <= most:
        raise ValueError("another size is inside than the map has")
    return zstandard.ZstdDecompressor().decompress(data)


def _int16(data: bytes, height: int, width: int) -> NDArray[np.int16]:
    return np.frombuffer(data, "<i2").reshape(height, width)


def _long_residuals(second: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """The residuals of 15 and more: a byte of residual − 15, or 255 and 16 bits."""
    # 255 is also found within the 16 bits of others: from each one that counts to the next.
    marks = np.flatnonzero(second == 255)
    following = [int(mark) for mark in np.searchsorted(marks, marks + 3)]
    counting = []
    i = 0
    while i < len(following):
        counting.append(i)
        i = following[i]
    at = marks[counting]
    if at.size and at[-1] + 3 > second.size:
        raise ValueError("the bytes end within a residual")
    values = second.astype(np.uint16) + np.uint16(15)
    values[at] = second[at + 1] | second[at + 2].astype(np.uint16) << 8
    if (values[at] < 15 + 255).any():
        raise ValueError("a residual is longer than it needs to be")
    return np.delete(values, np.concatenate((at + 1, at + 2)))


def _predict_zstd(data: bytes, height: int, width: int) -> NDArray[np.int16]:
    """Residuals of left + above − above left, zigzag, modulo 2¹⁶: first a nibble for each, 15 for
    those that follow in the second part. The map is their running sum along rows and columns."""
    pixels = height * width
    first = (pixels + 1) // 2
    content = np.frombuffer(_unpack(data, first, first + 3 * pixels), np.uint8)
    nibbles = np.empty(2 * first, np.uint16)
    nibbles[0::2] = content[:first] & 15
    nibbles[1::2] = content[:first] >> 4
    if nibbles[pixels:].any():
        raise ValueError("a nibble lies beyond the map")
    zigzag = nibbles[:pixels]
    zigzag_long = _long_residuals(content[first:])
    escapes = np.flatnonzero(zigzag == 15)
    if escapes.size != zigzag_long.size:
        raise ValueError("the two parts do not fit")
    zigzag[escapes] = zigzag_long
    residuals = (zigzag >> 1) ^ (0 - (zigzag & 1))
    sums = np.cumsum(residuals.reshape(height, width), axis=1, dtype=np.uint16)
    return np.cumsum(sums, axis=0, dtype=np.uint16).view(np.int16)


_DECODERS: dict[int, Callable[[bytes, int, int], NDArray[np.int16]]] = {
    value_of("DEPTH_INT16"): _int16,
    value_of("DEPTH_PREDICT_ZSTD"): _predict_zstd,
}


def depth_values(depth: Message) -> NDArray[np.int16]:
    """The values of a DepthMap: int16 (H, W), in its `um_per_unit`, `untrusted_value` where not
    to be believed. ProtocolError for a map that does not decode."""
    height, width = depth.height, depth.width
    try:
        if height < 1 or width < 1 or height * width > _MAX_PIXELS:
            raise ValueError(f"{width} × {height} pixels")
        decoder = _DECODERS.get(depth.encoding)
        if decoder is None:
            raise ValueError(f"encoding {depth.encoding} is unknown here")
        return decoder(depth.data, height, width)
    except (ValueError, zstandard.ZstdError) as e:
        raise ProtocolError(
            f"a depth map of the daemon cannot be decoded ({e}): install the same release on both "
            "sides"
        ) from e
