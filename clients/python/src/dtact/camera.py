"""The sensor as a camera of LeRobot's shape, without LeRobot: what its robots, recorder and tools
call on a camera is here, with the names, arguments and exceptions of lerobot.cameras.Camera
(release 0.6, huggingface/lerobot pull request 3644 for the depth). lerobot_camera_dtact makes a
LeRobot camera of it."""
from __future__ import annotations

import json
import os
import shutil
import subprocess
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .address import DEFAULT_HOST
from .client import Client
from .errors import ConnectionError, Error, NoFrame
from .frame import Frame
from .subscription import Subscription
from .values import Status

#: The depth that is shown as the brightest colour, as in recordings' pictures.
SHOWN_MM = 2.0
# Black, violet, red, orange, light yellow: lighter all the way, so that it also reads in grey.
_COLOURS = np.array([(0, 0, 0), (80, 18, 123), (183, 55, 121), (251, 135, 97), (252, 253, 191)])


def _colour_table() -> NDArray[np.uint8]:
    at = np.linspace(0, 255, len(_COLOURS))
    channels = [np.interp(np.arange(256), at, _COLOURS[:, c]) for c in range(3)]
    return np.stack(channels, axis=1).round().astype(np.uint8)


_TABLE = _colour_table()


def colour(depth_mm: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Depth as a picture: uint8 (H, W, 3), RGB; black where nothing is pressed or not to be
    believed, lighter the deeper, lightest from SHOWN_MM on. `depth_mm`: float32 (H, W)."""
    shade = np.nan_to_num(depth_mm, nan=0.0) * (255 / SHOWN_MM)
    return _TABLE[np.clip(shade, 0, 255).astype(np.uint8)]


def _finest(status: Status) -> int:
    """By what the finest depth map that always comes is smaller than the calibration's:
    reconstruction.resolution, whose "auto" is a quarter now and then, and camera.decode_scale."""
    size, camera = status.calibration, status.message.camera
    finest = {"half": 2, "quarter": 4, "auto": 4}.get(status.message.reconstruction.resolution, 1)
    if size and size.frame_width and camera.width:
        finest = max(finest, size.frame_width // camera.width)
    return finest


def _of_this_machine() -> list[dict[str, Any]]:
    try:
        with Client(timeout=1.0, program="dtact find_cameras") as client:
            status, server = client.status(), client.server
    except Error:
        return []
    size = status.calibration
    finest = _finest(status)
    return [{
        "name": server.name or f"dtact {server.serial}".strip(),
        "type": "dtact",
        "id": DEFAULT_HOST,
        "serial": server.serial,
        "default_stream_profile": {
            "width": size.width // finest if size else None,
            "height": size.height // finest if size else None,
            "fps": status.fps,
        },
    }]


class Camera:
    """One sensor. Between connect() and disconnect() a thread reads it, so that the newest frame is
    always available.

    :param address: see dtact.Client, as for `token`, `token_file`, `fingerprint` and `ca_file`.
    :param fps: frames a second, at most the daemon's; None: the daemon's.
    :param width: and `height`: size of depth and image in pixels, the daemon's or a half or a
        quarter of it; None: the largest that always comes, of resolution "auto" a quarter.
    :param use_rgb: and `use_depth`, as in LeRobot's depth cameras; one of them at least.
    :param picture: "depth": the image is the depth in colours; "camera": the camera's own image, grey,
        of the camera's size, without depth.
    """

    # What is raised where the camera is not connected, and where it is already.
    _NotConnected: type[Exception] = ConnectionError
    _AlreadyConnected: type[Exception] = ConnectionError

    def __init__(
        self,
        address: str = DEFAULT_HOST,
        *,
        fps: int | None = None,
        width: int | None = None,
        height: int | None = None,
        use_rgb: bool = True,
        use_depth: bool = True,
        picture: str = "depth",
        token: str | None = None,
        token_file: str | Path | None = None,
        fingerprint: str | None = None,
        ca_file: str | Path | None = None,
    ) -> None:
        if fps is not None and fps <= 0:
            raise ValueError(f"fps is {fps}: it has to be above 0, or left out for the daemon's")
        if not (use_rgb or use_depth):
            raise ValueError("use_rgb and use_depth are both off: nothing would be read")
        if picture not in ("depth", "camera"):
            raise ValueError(f'picture is "{picture}": it has to be "depth" or "camera"')
        if picture == "camera" and use_depth:
            raise ValueError('picture "camera" has another size than depth: set use_depth to False, and '
                             "configure a second camera of the same address for the depth")
        self.fps = fps
        self.width = width
        self.height = height
        self._left_out: list[str] = []  # What the last connection set of these three.
        self.use_rgb = use_rgb
        self.use_depth = use_depth
        self._camera_picture = picture == "camera"
        self._address = address
        self._process = 0  # That has connected.
        self._identity: dict[str, Any] = {
            "token": token, "token_file": token_file, "fingerprint": fingerprint,
            "ca_file": ca_file}
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._changed = threading.Condition()
        # Written by the reading thread, guarded by `_changed`:
        self._newest: Frame | None = None
        self._came_at = 0.0  # time.perf_counter()
        self._count = 0
        self._error: Exception | None = None
        # What async_read() and async_read_depth() have given last.
        self._seen = {"rgb": 0, "depth": 0}

    def __enter__(self) -> Camera:
        self.connect()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.disconnect()

    @property
    def is_connected(self) -> bool:
        """Whether frames are being read."""
        return self._thread is not None and self._thread.is_alive() and self._error is None

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        """Finds the daemon of this machine at the default address, and those announced in the
        network (by `dtactctl find`, if installed). Each entry has "name", "type", "id" (the address)
        and "serial"; this machine's also "default_stream_profile" with width, height and fps."""
        found = _of_this_machine()
        program = shutil.which("dtactctl")
        if program is not None:
            ran = subprocess.run([program, "find", "--json", "--seconds", "1"], capture_output=True,
                                 text=True, check=False)
            for line in ran.stdout.splitlines():
                one = json.loads(line)
                host = f"[{one['address']}]" if ":" in one["address"] else one["address"]
                found.append({"name": one["name"], "type": "dtact", "id": f"{host}:{one['port']}",
                              "serial": one.get("serial", "")})
        return found

    def connect(self, warmup: bool = True) -> None:
        """Connects and starts to read, also after the connection broke. `warmup`: returns once the
        first depth is there. Sets fps, width and height where they were left out. ConnectionError;
        ValueError for a size or rate that the daemon cannot give."""
        if self.is_connected:
            raise self._AlreadyConnected(f"{self} is already connected")
        if self._thread is not None:
            self.disconnect()  # What is left of a connection that broke.
        client = Client(self._address, program="dtact camera", kept_frames=1, **self._identity)
        try:
            client.subscribe(self._subscription(client))
        except BaseException:
            client.close()
            raise
        self._process = os.getpid()
        self._stop.clear()
        self._newest = self._error = None
        self._count = 0
        self._seen = {"rgb": 0, "depth": 0}
        self._thread = threading.Thread(target=self._read_loop, args=(client,), daemon=True,
                                        name=f"{self}")
        self._thread.start()
        if warmup:
            try:
                self._after(0, 10_000)
            except BaseException:
                self.disconnect()
                raise

    def disconnect(self) -> None:
        """Ends the connection."""
        if self._thread is None:
            raise self._NotConnected(f"{self} is not connected")
        self._stop.set()
        self._thread.join()
        self._thread = None

    # ------------------------------------------------------------ pictures

    def read(self) -> NDArray[np.uint8]:
        """The next frame's depth in colours, or the camera's image: uint8 (H, W, 3), RGB. Waits for it."""
        return self._picture(self._after(self._checked("rgb"), 10_000))

    def async_read(self, timeout_ms: float = 200) -> NDArray[np.uint8]:
        """The newest frame's that this has not given yet; waits up to `timeout_ms` for one.
        TimeoutError."""
        self._checked("rgb")
        return self._picture(self._after(self._seen["rgb"], timeout_ms, "rgb"))

    def read_latest(self, max_age_ms: int = 500) -> NDArray[np.uint8]:
        """The newest frame's, without waiting. TimeoutError when it came longer than `max_age_ms`
        ago, RuntimeError when none came yet; where the connection broke, instead of both what
        broke it."""
        self._checked("rgb")
        return self._picture(self._latest(max_age_ms))

    # ------------------------------------------------------------ depth

    def read_depth(self) -> NDArray[np.float32]:
        """The next frame's indentation: float32 (H, W, 1) in metres, positive = pressed. Untrusted
        pixels are 0, because LeRobot's encoder cannot store NaN."""
        return self._metres(self._after(self._checked("depth"), 10_000))

    def async_read_depth(self, timeout_ms: float = 200) -> NDArray[np.float32]:
        """Like async_read(), with the values of read_depth()."""
        self._checked("depth")
        return self._metres(self._after(self._seen["depth"], timeout_ms, "depth"))

    def read_latest_depth(self, max_age_ms: int = 500) -> NDArray[np.float32]:
        """Like read_latest(), with the values of read_depth()."""
        self._checked("depth")
        return self._metres(self._latest(max_age_ms))

    # ------------------------------------------------------------ inside

    def __str__(self) -> str:
        return f"{type(self).__name__}({self._address})"

    def _subscription(self, client: Client) -> Subscription:
        """What is asked of the daemon; completes fps, width and height."""
        for name in self._left_out:  # The daemon may have others by now.
            setattr(self, name, None)
        self._left_out = [name for name in ("fps", "width", "height") if getattr(self, name) is None]
        status = client.status()
        size = status.message.camera if self._camera_picture else status.calibration
        if size is None:
            raise ConnectionError(f"{self}: the daemon has no calibration. {status.advice}")
        finest = 1 if self._camera_picture else _finest(status)
        if self.width is None and self.height is None:
            self.width, self.height = size.width // finest, size.height // finest
        divisors = [1] if self._camera_picture else [d for d in (4, 2, 1) if d >= finest]
        sizes = {(size.width // d, size.height // d): d for d in divisors}
        decimation = sizes.get((self.width or 0, self.height or 0))
        if decimation is None:
            possible = ", ".join(f"{w} × {h}" for w, h in reversed(sizes))
            what = "camera's image" if self._camera_picture else "depth"
            raise ValueError(f"{self}: {self.width} × {self.height} is no size of this daemon's "
                             f"{what}: it gives {possible}")
        camera_fps = float(status.message.camera.fps) or status.fps
        if self.fps is None:
            self.fps = round(camera_fps)
        # A camera that states 30 may be measured at 29.
        if self.fps > 1.1 * camera_fps:
            raise ValueError(f"{self}: {self.fps} frames a second were asked for, and the daemon's "
                             f"camera delivers {camera_fps:.3g}")
        limit = self.fps if self.fps < round(camera_fps) else 0
        if self._camera_picture:
            return Subscription(depth=None, luma=True, luma_hz=limit)
        return Subscription(decimation=decimation, depth_hz=limit)

    def _read_loop(self, client: Client) -> None:
        error: Exception = ConnectionError(f"{self} was disconnected")
        try:
            with client:
                while not self._stop.is_set():
                    frame = client.next(0.1)
                    if isinstance(frame, Frame) and (
                            frame.has_luma if self._camera_picture else frame.has_depth):
                        with self._changed:
                            self._newest = frame
                            self._came_at = time.perf_counter()
                            self._count += 1
                            self._changed.notify_all()
        except Exception as e:
            error = e
        with self._changed:
            self._error = error
            self._changed.notify_all()

    def _checked(self, what: str) -> int:
        """How many frames came so far. Raises when `what` cannot be read."""
        if self._thread is None:
            raise self._NotConnected(f"{self} is not connected: call connect() first")
        if self._process != os.getpid():
            raise self._NotConnected(f"{self} was connected by process {self._process}, and this is "
                                     f"process {os.getpid()}: call connect() after the fork")
        if not (self.use_rgb if what == "rgb" else self.use_depth):
            raise RuntimeError(f"{self} was made with use_{what}=False")
        with self._changed:
            return self._count

    def _after(self, count: int, timeout_ms: float, reader: str = "") -> Frame:
        """The newest frame once more than `count` came."""
        with self._changed:
            self._changed.wait_for(lambda: self._count > count or self._error, timeout_ms / 1e3)
            if self._count > count and self._newest is not None:
                if reader:
                    self._seen[reader] = self._count
                return self._newest
            if self._error is not None:
                raise self._lost(self._error) from self._error
        raise NoFrame(f"{self}: no new frame within {timeout_ms:g} ms; dtactctl status says why")

    def _lost(self, error: Exception) -> Exception:
        """The error as a reader gets it: one that says more than a lost connection stays."""
        return error if isinstance(error, self._NotConnected) else self._NotConnected(str(error))

    def _latest(self, max_age_ms: float) -> Frame:
        with self._changed:
            frame, age_ms = self._newest, (time.perf_counter() - self._came_at) * 1e3
            error = self._error
        if error is not None and (frame is None or age_ms > max_age_ms):
            raise self._lost(error) from error
        if frame is None:
            raise RuntimeError(f"{self}: no frame has come yet")
        if age_ms > max_age_ms:
            raise NoFrame(f"{self}: the newest frame came {age_ms:.0f} ms ago, at most "
                          f"{max_age_ms:g} were asked for")
        return frame

    def _picture(self, frame: Frame) -> NDArray[np.uint8]:
        if self._camera_picture:
            return np.repeat(frame.luma[:, :, np.newaxis], 3, axis=2)
        return colour(frame.depth_mm)

    def _metres(self, frame: Frame) -> NDArray[np.float32]:
        return np.nan_to_num(frame.depth_mm, nan=0.0)[:, :, np.newaxis] * np.float32(1e-3)
