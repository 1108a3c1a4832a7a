"""The camera class that LeRobot finds by the name of its configuration."""
from __future__ import annotations

import dtact
from lerobot.cameras.camera import Camera

from .config import DtactCameraConfig


class DtactCamera(dtact.Camera, Camera):
    """dtact.Camera, made from a configuration."""

    def __init__(self, config: DtactCameraConfig) -> None:
        Camera.__init__(self, config)
        dtact.Camera.__init__(
            self,
            config.address,
            fps=config.fps,
            width=config.width,
            height=config.height,
            use_rgb=config.use_rgb,
            use_depth=config.use_depth,
            token_file=config.token_file,
            fingerprint=config.fingerprint,
        )
        self.config = config
