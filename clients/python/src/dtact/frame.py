"""One frame: the depth map, the pictures and what was measured with them."""
from __future__ import annotations

from datetime import datetime
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from .encodings import depth_values
from .errors import NotInFrame, ProtocolError
from .geometry import ObjectPose, PointCloud, Surface
from .messages import Message, name_of
from .values import Contact, Light, Recognition, health_names, wall_time


@lru_cache(maxsize=8)
def _millimetres(um_per_unit: float, untrusted: int) -> NDArray[np.float32]:
    """What each int16 means, in the order of uint16: one look-up a pixel, and the same rounding as
    the C++ library's."""
    values = np.arange(1 << 16, dtype=np.uint16).view(np.int16)
    mm = (values * um_per_unit * 1e-3).astype(np.float32)
    mm[values == untrusted] = np.nan
    return mm


class Frame:
    """One frame of the daemon. Pixels are decoded when they are first asked for."""

    def __init__(self, message: Message) -> None:
        #: dtact.proto's Frame, with all that the attributes here do not name.
        self.message = message

    # ------------------------------------------------------------ depth

    @property
    def has_depth(self) -> bool:
        """Whether it holds a depth map: not when none was subscribed or the sensor is not
        calibrated."""
        return bool(self.message.HasField("depth"))

    @cached_property
    def depth_mm(self) -> NDArray[np.float32]:
        """Indentation in millimetres: float32 (H, W), positive = pressed, NaN where not to be
        believed. Row 0 is the top of the camera's picture. NotInFrame without one."""
        depth = self._depth
        table = _millimetres(depth.um_per_unit, depth.untrusted_value)
        return table.take(self.depth_values.view(np.uint16))

    @cached_property
    def depth_values(self) -> NDArray[np.int16]:
        """The same as it was sent: int16 (H, W) in `um_per_unit` micrometres, `untrusted_value`
        where not to be believed."""
        return depth_values(self._depth)

    @property
    def um_per_unit(self) -> float:
        """Micrometres a unit of `depth_values`."""
        return float(self._depth.um_per_unit)

    @property
    def untrusted_value(self) -> int:
        """The value in `depth_values` that marks an untrusted pixel."""
        return int(self._depth.untrusted_value)

    @property
    def uncertainty_mm(self) -> float:
        """Mean absolute error to expect inside the contact, millimetres. It does not include the
        effects that the flags in `health` warn of."""
        return float(self._depth.uncertainty_um) * 1e-3

    @property
    def mm_per_px(self) -> float:
        """Side of a pixel of the depth map on the surface, millimetres."""
        return float(self._depth.mm_per_px)

    @property
    def decimation(self) -> int:
        """1, 2 or 4: pixels of the calibration's resolution along the side of one of the map."""
        return int(self._depth.decimation) or 1

    @property
    def sharpen_steps(self) -> int:
        """Sharpening steps against the gel's scattering, applied before the LUT; 0: none."""
        return int(self._depth.sharpen_steps)

    @property
    def origin_px(self) -> tuple[int, int]:
        """Column and row of the map's first pixel in the whole map, in the map's pixels: (0, 0)
        unless a region was subscribed."""
        return int(self._depth.x), int(self._depth.y)

    @property
    def full_shape(self) -> tuple[int, int]:
        """Height and width of the whole map, in the map's pixels."""
        depth = self._depth
        return depth.full_height, depth.full_width

    @property
    def _depth(self) -> Message:
        if not self.has_depth:
            flags = ", ".join(self.health)
            raise NotInFrame(
                f"frame {self.sequence} has no depth map"
                + (f" ({flags})" if flags else "")
                + ": either none was subscribed, or status() says what is missing"
            )
        return self.message.depth

    # ------------------------------------------------------------ made of the depth

    @cached_property
    def contact_mask(self) -> NDArray[np.bool_]:
        """Where the object is in contact: bool (H, W), pressed deeper than `contact.threshold_mm`.
        NotInFrame where the contact was not measured."""
        values = self.depth_values
        if self.contact is None:
            raise NotInFrame(f"the contact of frame {self.sequence} was not measured: "
                             f"{self.contact_absence}")
        threshold_um = round(self.contact.threshold_mm * 1e3)
        return np.asarray((values * self.um_per_unit > threshold_um)
                          & (values != self.untrusted_value) & self.contact.in_contact)

    @cached_property
    def gradients(self) -> NDArray[np.float32]:
        """Slope of the indentation, millimetres per millimetre: float32 (H, W, 2), along x (columns, to
        the right) and y (rows, down). NaN beside untrusted pixels."""
        slopes = [np.gradient(self.depth_mm, self.mm_per_px, axis=axis)
                  if self.depth_mm.shape[axis] > 1 else np.full_like(self.depth_mm, np.nan)
                  for axis in (1, 0)]
        return np.asarray(np.stack(slopes, axis=-1), np.float32)

    def points(self) -> PointCloud:
        """The deformed surface as points with outward normals, like the `cloud` of dtact-perceive.
        NotInFrame for a curved surface, whose points dtact-perceive makes."""
        depth = self._depth
        if self.surface.shape != "plane":
            raise NotInFrame(f"the gel's surface is a {self.surface.shape}: connect to dtact-perceive, "
                             "which makes its points (Subscription(cloud=...))")
        return PointCloud.of_plane(self.depth_mm, self.mm_per_px, self.origin_px,
                                   (depth.full_height, depth.full_width), self.decimation,
                                   self.surface)

    # ------------------------------------------------------------ pictures

    @property
    def has_luma(self) -> bool:
        """Whether it holds the camera's picture in grey. One captured before it was subscribed does
        not, though it may come after."""
        return bool(self.message.HasField("luma"))

    @property
    def has_jpeg(self) -> bool:
        """Whether it holds the camera's own JPEG, as with `has_luma`."""
        return bool(self.message.HasField("jpeg"))

    @cached_property
    def luma(self) -> NDArray[np.uint8]:
        """The camera's picture in grey: uint8 (H, W) of the camera's size. NotInFrame without."""
        if not self.has_luma:
            raise NotInFrame(f"frame {self.sequence} has no luma: Subscription(luma=True) asks for it")
        luma = self.message.luma
        if luma.encoding != 1 or len(luma.data) != luma.width * luma.height:
            raise ProtocolError("a luma map of the daemon is damaged or in an unknown encoding: "
                                "install the same release on both sides")
        return np.frombuffer(luma.data, np.uint8).reshape(luma.height, luma.width)

    @property
    def jpeg(self) -> bytes:
        """The camera's own JPEG, not decoded; it may be broken inside. NotInFrame without one."""
        if not self.has_jpeg:
            raise NotInFrame(f"frame {self.sequence} has no JPEG: either Subscription(jpeg=True) was "
                             "not asked for, or the camera delivers another format")
        return bytes(self.message.jpeg.data)

    @cached_property
    def surface(self) -> Surface:
        """The undeformed gel's, along whose normal depth is, and where the camera stands; a plane unless
        the calibration says otherwise. A frame without depth does not say."""
        return Surface.of(self.message.surface)

    # ------------------------------------------------------------ of dtact-perceive

    @property
    def has_cloud(self) -> bool:
        """Whether it holds points: not when none were subscribed or there is no contact."""
        return bool(self.message.HasField("cloud"))

    @cached_property
    def cloud(self) -> PointCloud:
        """The deformed surface as points. NotInFrame without them."""
        if not self.has_cloud:
            raise NotInFrame(f"frame {self.sequence} has no point cloud: either there is no contact, or "
                             "Subscription(cloud=...) was not asked for; dtact-perceive makes them")
        return PointCloud.of(self.message.cloud)

    @cached_property
    def pose(self) -> ObjectPose | None:
        """Motion of the object in contact. None when not subscribed, without contact, and until the
        contact is about half a square millimetre large."""
        return ObjectPose.of(self.message.pose) if self.message.HasField("pose") else None

    @cached_property
    def recognition(self) -> Recognition | None:
        """What the object in contact is. None when not subscribed, without contact, and until the first
        answer."""
        if not self.message.HasField("recognition"):
            return None
        return Recognition.of(self.message.recognition)

    # ------------------------------------------------------------ what was measured

    @cached_property
    def contact(self) -> Contact | None:
        """The contact. None when it was not measured, which differs from no contact:
        `contact_absence` says why."""
        return Contact.of(self.message.contact) if self.message.HasField("contact") else None

    @property
    def contact_absence(self) -> str:
        """Why `contact` is None: "uncalibrated", "referencing", "unasked"; "none" when it is there."""
        return name_of("ContactAbsence", self.message.contact_absence, "CONTACT_ABSENCE_")

    @cached_property
    def health(self) -> tuple[str, ...]:
        """Names of the health flags that are set; empty when all is well."""
        return health_names(self.message.health)

    @cached_property
    def light(self) -> Light:
        """The ring at the time of exposure."""
        return Light.of(self.message.light)

    @property
    def calibration(self) -> int | None:
        """The number of the calibration that made the depth, if it has one."""
        return int(self.message.calibration) if self.message.HasField("calibration") else None

    # ------------------------------------------------------------ when

    @property
    def sequence(self) -> int:
        """The camera's number of the frame; a gap is frames lost, skipped or not asked for."""
        return int(self.message.sequence)

    @property
    def time(self) -> datetime:
        """When it was exposed, in UTC by the daemon's clock."""
        return wall_time(self.message.wall_ns)

    @property
    def monotonic_s(self) -> float:
        """The same moment on CLOCK_MONOTONIC of the daemon's machine, in seconds. There it is
        time.monotonic()."""
        return float(self.message.monotonic_ns) * 1e-9

    @property
    def published_s(self) -> float:
        """When the depth was done, as `monotonic_s`."""
        return float(self.message.published_ns) * 1e-9

    @property
    def time_meaning(self) -> str:
        """Which moment `time` and `monotonic_s` are: "start_of_exposure", "end_of_frame",
        "arrival" or "first_packet"."""
        return name_of("TimestampMeaning", self.message.meaning, "TIMESTAMP_")

    @property
    def dropped(self) -> int:
        """Frames that this connection has missed since it was made."""
        return int(self.message.dropped)

    def __repr__(self) -> str:
        depth = self.message.depth
        size = f"{depth.width} × {depth.height}" if self.has_depth else "none"
        return f"<dtact.Frame {self.sequence}, depth {size}, {self.time.isoformat()}>"
