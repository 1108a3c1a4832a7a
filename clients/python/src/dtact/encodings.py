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


def _unpack(data: bytes, size: int) -> bytes:
    """`data` as zstd of exactly `size` bytes. What the frame says of itself comes first, so that
    a short message cannot make us allocate much."""
    if zstandard.frame_content_size(data) != size:
        raise ValueError("another size is inside than the map has")
    return zstandard.ZstdDecompressor().decompress(data)


def _int16(data: bytes, height: int, width: int) -> NDArray[np.int16]:
    return np.frombuffer(data, "<i2").reshape(height, width)


def _delta_zstd(data: bytes, height: int, width: int) -> NDArray[np.int16]:
    """Differences to the left neighbour within each row, modulo 2¹⁶."""
    differences = np.frombuffer(_unpack(data, 2 * height * width), "<u2").reshape(height, width)
    return np.cumsum(differences, axis=1, dtype=np.uint16).view(np.int16)


def _rvl_decode(data: bytes, height: int, width: int) -> NDArray[np.int16]:
    if _rvl is None:
        raise ValueError("it is RVL, which this installation was built without")
    return np.frombuffer(_rvl.decode(data, height * width), np.int16).reshape(height, width)


_DECODERS: dict[int, Callable[[bytes, int, int], NDArray[np.int16]]] = {
    value_of("DEPTH_INT16"): _int16,
    value_of("DEPTH_DELTA_ZSTD"): _delta_zstd,
    value_of("DEPTH_RVL"): _rvl_decode,
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
