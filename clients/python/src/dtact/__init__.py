"""Depth from a dtactd tactile sensor, as numpy arrays in millimetres.

    import dtact

    with dtact.connect("gripper") as s:
        for f in s.frames():
            print(f.depth_mm.shape, f.contact)
"""
from . import aio
from .camera import Camera
from .client import Client
from .errors import (
    Busy,
    ConnectionError,
    Denied,
    DeviceFailed,
    EndedByDaemon,
    Error,
    IdentityError,
    Invalid,
    NoFrame,
    NotInFrame,
    ProtocolError,
    Refused,
    SharedClient,
    StorageFailed,
    TimeoutError,
    InContact,
    Uncalibrated,
    Unsupported,
)
from .event import (
    CalibrationEvent,
    ContactEvent,
    Event,
    LightEvent,
    Reconnected,
    ReconstructionEvent,
    ReferenceEvent,
    StateEvent,
)
from .frame import Frame
from .geometry import ObjectPose, PointCloud, Surface
from .mcap import read
from .recording import Recording
from .subscription import Subscription
from .values import (
    CalibrationFiles,
    CalibrationSummary,
    CameraSetting,
    CameraSettings,
    Contact,
    Light,
    Pong,
    Recognition,
    Reconstruction,
    ReferenceImage,
    Server,
    Status,
    StoredCalibration,
)

#: `with connect("gripper") as client`; see Client.
connect = Client

__all__ = [
    "Busy", "CalibrationEvent", "CalibrationFiles", "CalibrationSummary", "Camera", "CameraSetting",
    "CameraSettings", "Client", "ConnectionError", "Contact", "ContactEvent", "Denied", "DeviceFailed", "EndedByDaemon",
    "Error", "Event", "Frame", "IdentityError", "InContact", "Invalid", "Light", "LightEvent", "NoFrame",
    "NotInFrame", "ObjectPose", "PointCloud", "Pong", "ProtocolError", "Recognition",
    "Reconnected", "Reconstruction", "ReconstructionEvent", "Recording", "ReferenceEvent", "ReferenceImage",
    "Refused", "Server", "SharedClient", "StateEvent", "Status", "StorageFailed", "StoredCalibration",
    "Subscription", "Surface", "TimeoutError", "Uncalibrated", "Unsupported", "aio", "connect",
    "read",
]
