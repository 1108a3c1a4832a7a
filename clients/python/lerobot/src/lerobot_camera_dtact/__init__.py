"""A dtactd tactile sensor as a camera of LeRobot, type "dtact"."""
from .camera import DtactCamera
from .config import DtactCameraConfig

__all__ = ["DtactCamera", "DtactCameraConfig"]
