"""A robot's configuration under `cameras`. LeRobot writes and reads it by the types of its fields, which
therefore are types and not, as `from __future__ import annotations` makes them, their names."""
from dataclasses import dataclass

from lerobot.cameras.configs import CameraConfig


@CameraConfig.register_subclass("dtact")
@dataclass(kw_only=True)
class DtactCameraConfig(CameraConfig):
    """`fps`, `width` and `height` come from CameraConfig; left out, they are the daemon's."""

    address: str = "127.0.0.1"  #: "host", "host:port" or "unix:/path"
    use_rgb: bool = True
    use_depth: bool = True
    picture: str = "depth"  #: or "camera", see dtact.Camera
    token_file: str | None = None
    fingerprint: str | None = None  #: of the daemon's certificate, beyond this machine
