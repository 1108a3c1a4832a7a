"""The pixels in the bytes of a DepthMap: proto/README.md says what they are, byte for byte."""
from __future__ import annotations

from typing import Callable

import numpy as np
import zstandard
from numpy.typing import NDArray

from .errors import ProtocolError
from .messages import Message, value_of

try:
    from . import _rvl
except ImportError:  # Installed without a compiler.
    _rvl = None  # type: ignore[assignment]

# The largest map of a daemon: what a message can hold as int16.
_MOST_PIXELS = (16 << 20) // 2


def _unpack(data: bytes, least: int, most: int) -> bytes:
    """What is in a zstd frame, `least` … `most` bytes. What the frame says of itself comes first,
    so that a short message cannot make us allocate much."""
    if not least <= zstandard.frame_content_size(data) <= most:
        raise ValueError("another size is inside than the map has")
    return zstandard.ZstdDecompressor().decompress(data)


def _int16(data: bytes, height: int, width: int) -> NDArray[np.int16]:
    return np.frombuffer(data, "<i2").reshape(height, width)


def _delta_zstd(data: bytes, height: int, width: int) -> NDArray[np.int16]:
    """Differences to the left neighbour within each row, modulo 2¹⁶."""
    size = 2 * height * width
    differences = np.frombuffer(_unpack(data, size, size), "<u2").reshape(height, width)
    return np.cumsum(differences, axis=1, dtype=np.uint16).view(np.int16)


def _long_residuals(second: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """The residuals of 15 and more: a byte of residual − 15, or 255 and 16 bits."""
    starts = np.ones(second.size, np.bool_)
    long = []
    behind = 0
    # Few are so long. Between two of them each byte is a residual.
    for at in np.flatnonzero(second == 255):
        if at >= behind:
            behind = at + 3
            starts[at + 1 : behind] = False
            long.append(at)
    if behind > second.size:
        raise ValueError("the bytes end within a residual")
    values = second.astype(np.uint16) + np.uint16(15)
    if long:
        at = np.array(long)
        values[at] = second[at + 1] | second[at + 2].astype(np.uint16) << 8
        if (values[at] < 15 + 255).any():
            raise ValueError("a residual is longer than it needs to be")
    return values[starts]


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


def _rvl_decode(data: bytes, height: int, width: int) -> NDArray[np.int16]:
    if _rvl is None:
        raise ValueError("it is RVL, which this installation was built without")
    return np.frombuffer(_rvl.decode(data, height * width), np.int16).reshape(height, width)


_DECODERS: dict[int, Callable[[bytes, int, int], NDArray[np.int16]]] = {
    value_of("DEPTH_INT16"): _int16,
    value_of("DEPTH_DELTA_ZSTD"): _delta_zstd,
    value_of("DEPTH_RVL"): _rvl_decode,
    value_of("DEPTH_PREDICT_ZSTD"): _predict_zstd,
}


def has_rvl() -> bool:
    """Whether the C extension was built, without which RVL is not asked for."""
    return _rvl is not None


def depth_values(depth: Message) -> NDArray[np.int16]:
    """The values of a DepthMap: int16 (H, W), in its `um_per_unit`, `untrusted_value` where not
    to be believed. ProtocolError for a map that does not decode."""
    height, width = depth.height, depth.width
    try:
        if height < 1 or width < 1 or height * width > _MOST_PIXELS:
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
