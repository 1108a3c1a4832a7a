"""A robot's configuration under `cameras`."""
from __future__ import annotations

from dataclasses import dataclass

from lerobot.cameras.configs import CameraConfig


@CameraConfig.register_subclass("dtact")
@dataclass(kw_only=True)
class DtactCameraConfig(CameraConfig):
    """`fps`, `width` and `height` come from CameraConfig; left out, they are the daemon's."""

    address: str = "127.0.0.1"  #: "host", "host:port" or "unix:/path"
    use_rgb: bool = True
    use_depth: bool = True
    token_file: str | None = None
    fingerprint: str | None = None  #: of the daemon's certificate, beyond this machine
