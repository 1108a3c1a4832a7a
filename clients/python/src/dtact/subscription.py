"""The parts of each frame that a client subscribes to."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .messages import Message, message_class, value_of

Encoding = Literal["auto", "int16", "predict_zstd"]


@dataclass(frozen=True)
class Subscription:
    """The parts to be sent from now on; others are not sent. A limit of 0 Hz means no limit."""

    #: Encoding of depth; both give the same values. "auto": int16 on the daemon's own machine,
    #: where bandwidth is cheap; predict_zstd elsewhere. None: no depth.
    depth: Encoding | None = "auto"
    luma: bool = False  #: the camera's picture in grey
    jpeg: bool = False  #: the camera's own JPEG, if that is what it delivers
    summary: bool = False  #: frames also without maps: contact, health and times
    every: int = 1  #: every n-th frame
    depth_hz: float = 0.0  #: limit, depth maps a second, 0.01 … 1000
    luma_hz: float = 0.0
    jpeg_hz: float = 0.0
    summary_hz: float = 0.0
    decimation: int = 1  #: 1, 2 or 4 pixels averaged to one along each side
    um_per_unit: int = 1  #: depth in steps of 1, 2, 5 or 10 micrometres
    #: Part of the depth map: (x, y, width, height) in pixels of the calibration's resolution, or
    #: "contact": the box around what is pressed, and no map while nothing is.
    region: tuple[int, int, int, int] | Literal["contact"] | None = None
    events: bool = True
    #: Point cloud of the surface during contact, from dtact-perceive, which has no depth:
    #: "float32", or "int16" of half the size. `decimation` and `region` select the points.
    cloud: Literal["float32", "int16"] | None = None
    cloud_hz: float = 0.0
    pose: bool = False  #: motion of the object in contact, from dtact-perceive
    pose_hz: float = 0.0
    recognition: bool = False  #: what the object in contact is, from dtact-perceive
    recognition_hz: float = 0.0
    recognition_presses: int = 1  #: contacts with one object to join in an answer, at most 10

    def message(self, same_machine: bool) -> Message:
        """The request. ValueError for an encoding that is no Encoding."""
        request = message_class("Subscribe")()
        if self.depth is not None:
            request.depth = value_of(self._constant(same_machine))
        if self.luma:
            request.luma = value_of("LUMA_GREY8")
        request.every = self.every
        request.summary = self.summary
        request.jpeg = self.jpeg
        request.depth_hz = self.depth_hz
        request.luma_hz = self.luma_hz
        request.jpeg_hz = self.jpeg_hz
        request.summary_hz = self.summary_hz
        request.decimation = self.decimation
        request.um_per_unit = self.um_per_unit
        if self.region == "contact":
            request.contact_box = True
        elif self.region is not None:
            box = request.box
            box.x, box.y, box.width, box.height = self.region
        if not self.events:
            request.events = False
        if self.cloud is not None:
            if self.cloud not in ("float32", "int16"):
                raise ValueError(f'"{self.cloud}" is no encoding of points: "float32" or "int16"')
            request.cloud = value_of(f"CLOUD_{self.cloud.upper()}")
        request.cloud_hz = self.cloud_hz
        request.pose = self.pose
        request.pose_hz = self.pose_hz
        request.recognition = self.recognition
        request.recognition_hz = self.recognition_hz
        request.recognition_presses = self.recognition_presses
        return request

    def _constant(self, same_machine: bool) -> str:
        if self.depth == "auto":
            return "DEPTH_INT16" if same_machine else "DEPTH_PREDICT_ZSTD"
        if self.depth not in ("int16", "predict_zstd"):
            raise ValueError(f'"{self.depth}" is no encoding of depth: "auto", "int16" or '
                             '"predict_zstd"')
        return f"DEPTH_{self.depth.upper()}"
