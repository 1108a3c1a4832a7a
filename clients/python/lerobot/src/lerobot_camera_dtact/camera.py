"""The camera class that LeRobot finds by the name of its configuration."""
from __future__ import annotations

import logging

import dtact
from lerobot.cameras.camera import Camera
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from .config import DtactCameraConfig


class DtactCamera(dtact.Camera, Camera):
    """dtact.Camera, made from a configuration."""

    _NotConnected = DeviceNotConnectedError
    _AlreadyConnected = DeviceAlreadyConnectedError

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
            picture=config.picture,
            token_file=config.token_file,
            fingerprint=config.fingerprint,
        )
        self.config = config

    def connect(self, warmup: bool = True) -> None:
        """See dtact.Camera. Warns of a size that LeRobot's videos cannot have."""
        super().connect(warmup)
        if (self.width or 0) % 2 or (self.height or 0) % 2:
            logging.getLogger(__name__).warning(
                "%s gives %s × %s pixels, and LeRobot's default video encoder takes even sizes only: "
                "choose another size, or record images (--dataset.video=false)",
                self, self.width, self.height)
