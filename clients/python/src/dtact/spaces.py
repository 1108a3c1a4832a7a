"""For gymnasium, which is imported only when it is asked for."""
from __future__ import annotations

from typing import Any

import numpy as np

from .frame import Frame


def depth_box(frame: Frame) -> Any:
    """The gymnasium.spaces.Box that holds the depth maps of which `frame` is one: float32 (H, W),
    from the lowest to the highest int16 in the frame's unit."""
    try:
        from gymnasium.spaces import Box
    except ImportError as e:
        raise ImportError("observation_space needs gymnasium: pip install gymnasium") from e
    limits = np.iinfo(np.int16)
    unit_mm = frame.um_per_unit * 1e-3
    return Box(low=np.float32(limits.min * unit_mm), high=np.float32(limits.max * unit_mm),
               shape=frame.depth_mm.shape, dtype=np.float32)
