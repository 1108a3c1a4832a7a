"""The client that waits."""
from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from types import TracebackType
from typing import Any, TypeVar, cast

from . import requests
from .errors import ConnectionError, Error, NoFrame, ProtocolError, SharedClient, TimeoutError
from .event import Event
from .frame import Frame
from .protocol import Conversation
from .requests import Request, T
from .session import Session
from .spaces import depth_box
from .subscription import Subscription
from .transport import Link
from .values import (
    CalibrationFiles,
    CameraSettings,
    Light,
    Pong,
    Reconstruction,
    ReferenceImage,
    Status,
    StoredCalibration,
)

_Item = TypeVar("_Item")

#: Reads at one go while more lies ready: the newest frames count, and calls have to end.
_MAX_AT_ONCE = 4096


class Client(Session):
    __doc__ = (Session.__doc__ or "") + """
    Calls wait; one thread at a time, in the process that made it, else SharedClient. With `with`, or close() at the end. With `reconnect`, the last
    attempt to connect again may last for the client's `timeout` beyond the one given to a call."""

    _link: Link | None = None

    def _begin(self) -> None:
        self._in_use = threading.Lock()
        self._user = ""  # The name of the thread that has it.
        self._open(time.monotonic() + self._timeout)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Ends the connection; in a forked process, only this process's end of it."""
        # The lock may be one that another thread held at the fork.
        with self._call() if os.getpid() == self._process else nullcontext():
            self._lost(ConnectionError(f"the connection to {self._address} was closed"))
            self._reconnect = False

    # ------------------------------------------------------------ frames and events

    def subscribe(self, subscription: Subscription | None = Subscription()) -> None:
        """Replaces what is sent from now on; None ends it. Frames that came before are dropped:
        what frames() gives is as was asked last."""
        self._ask(self._subscribe_request(subscription))
        self._subscription = subscription

    def frames(self, timeout: float | None = None) -> Iterator[Frame]:
        """Yields frames without end. Subscribes to depth if nothing is subscribed. A slow reader gets
        the newest frame each time, or with `kept_frames` the oldest of those kept. Raises NoFrame when
        none arrives within `timeout` seconds (default: the client's timeout, or no limit with
        `reconnect`)."""
        if self._subscription is None:
            self.subscribe()
        limit = timeout if timeout is not None or self._reconnect else self._timeout
        while True:
            frame = self._wait(Conversation.take_frame, limit)
            if frame is None:
                raise NoFrame(self._no_frame(limit or 0, self.status()))
            yield frame

    def events(self, timeout: float | None = None) -> Iterator[Event]:
        """One event after another, those from before included; ends when none comes within
        `timeout` seconds. Frames go on to be kept for frames()."""
        while (event := self._wait(Conversation.take_event, timeout)) is not None:
            yield event

    def next(self, timeout: float | None = None) -> Frame | Event | None:
        """The next frame or event as they came; None when none came within `timeout` seconds."""
        return cast("Frame | Event | None", self._wait(Conversation.take, timeout))

    # ------------------------------------------------------------ requests
    # Each raises Refused with the daemon's sentence, or a ConnectionError.

    def status(self) -> Status:
        """How the daemon is."""
        return self._ask(requests.status())

    def set_light(self, brightness: int | None = None, scheme: str | None = None,
                  leds: Sequence[tuple[int, int, int]] | None = None) -> Light:
        """Changes the ring and returns once it shows it; what is left out stays. `brightness`:
        0 … 255. `scheme`: "all", "scheme1" … "scheme4". `leds`: eight colours (r, g, b)."""
        return self._ask(requests.set_light(brightness, scheme, leds))

    def set_camera(self, exposure_us: float | None = None, gain: float | None = None) -> CameraSettings:
        """Exposure and gain of the camera until the daemon ends; what is left out stays. The reference
        is taken anew. Returns both with their ranges."""
        return self._ask(requests.set_camera(exposure_us, gain))

    def set_reconstruction(self, resolution: str | None = None, sharpen: str | None = None,
                           max_error_um: float | None = None) -> Reconstruction:
        """How depth is made from now on, until the daemon ends; what is left out stays. Returns once
        frames are made so. `resolution`: "full", "half", "quarter", "auto". `sharpen`: "off", "1", "2",
        "auto". `max_error_um`: 1 … 10000, for "auto"."""
        return self._ask(requests.set_reconstruction(resolution, sharpen, max_error_um))

    def rezero(self, force: bool = False) -> None:
        """Takes a new reference image; `force`: even in contact."""
        self._ask(requests.rezero(force))

    def calibration(self, number: int | None = None) -> CalibrationFiles:
        """The files of one calibration; without a number, of the current one."""
        return self._ask(requests.calibration(number))

    def calibrations(self) -> list[StoredCalibration]:
        """All that the daemon has: the configured one, then the uploaded ones, oldest first. May
        take a few seconds."""
        return self._ask(requests.calibrations())

    def upload_calibration(self, files: CalibrationFiles) -> int:
        """Returns once the daemon uses and has stored it, with its number. May take a few
        seconds."""
        return self._ask(requests.upload_calibration(files))

    def activate_calibration(self, number: int) -> None:
        """Makes one of calibrations() current."""
        self._ask(requests.activate_calibration(number))

    def pin_calibration(self, number: int, pinned: bool = True) -> None:
        """A pinned calibration is not removed, whatever is uploaded later. Others go once ten have been
        in use since."""
        self._ask(requests.pin_calibration(number, pinned))

    def reference(self) -> ReferenceImage:
        """The reference image that depth is measured against at present."""
        return self._ask(requests.reference())

    def ping(self) -> Pong:
        """The daemon's clocks and the way's time."""
        return self._ask(requests.ping(time.monotonic))

    @property
    def observation_space(self) -> Any:
        """A gymnasium.spaces.Box of what `depth_mm` is under the present subscription: float32
        (H, W) in millimetres. NaN lies in no Box: numpy.nan_to_num() takes it out. Waits for a
        frame. ImportError without gymnasium."""
        return depth_box(next(frame for frame in self.frames() if frame.has_depth))

    # ------------------------------------------------------------ the connection

    @contextmanager
    def _call(self) -> Iterator[None]:
        """While this thread uses the connection. SharedClient when another one does, or when another
        process made it."""
        self._check_process()
        if not self._in_use.acquire(blocking=False):
            raise SharedClient(f"thread {self._user} is in a call of this client: one thread at a "
                               "time may use it; make a client for each thread")
        self._user = threading.current_thread().name
        try:
            yield
        finally:
            self._in_use.release()

    def _ask(self, request: Request[T]) -> T:
        with self._call():
            deadline = time.monotonic() + self._patience(request)
            if self._link is None:
                self._check_usable()
                self._open(deadline)
            return self._exchange(request, deadline)

    def _exchange(self, request: Request[T], deadline: float) -> T:
        number, data = self._prepare(request)
        assert self._link is not None
        try:
            self._link.send(data, deadline)
        except OSError as e:
            self._lost(self._broke(e))
        try:
            while number not in self._conversation.answers:
                if self._link is None:
                    raise self._broken
                if not self._read(deadline):
                    raise TimeoutError("the daemon gave no answer in time: look at journalctl -u dtactd")
        except BaseException:  # Ctrl-C too.
            self._conversation.forget(number)
            raise
        return self._answer(self._conversation.answers.pop(number), request)

    def _wait(self, take: Callable[[Conversation], _Item | None],
              limit: float | None) -> _Item | None:
        """What `take` finds once it finds something; None when that takes longer than `limit`."""
        with self._call():
            return self._taken(take, limit)

    def _taken(self, take: Callable[[Conversation], _Item | None],
               limit: float | None) -> _Item | None:
        deadline = math.inf if limit is None else time.monotonic() + limit
        while True:
            # The newest frames count: what lies ready comes first.
            for _ in range(_MAX_AT_ONCE):
                if self._link is None or not self._read(None):
                    break
            item = take(self._conversation)
            if item is not None:
                return item
            if self._link is None:
                self._check_usable()
                now = time.monotonic()
                if now < self._next_attempt:
                    if now >= deadline:
                        return None
                    time.sleep(min(deadline, self._next_attempt) - now)
                    continue
                try:
                    # Not only what is left of `limit`: who polls would never be connected again.
                    self._open(now + self._timeout)
                except ConnectionError:
                    pass  # Until the next attempt is due.
            elif not self._read(deadline):
                return None

    def _read(self, deadline: float | None) -> bool:
        """Reads once. False when nothing came in time (without a deadline: lay ready)."""
        assert self._link is not None
        try:
            count = self._link.receive(self._conversation.get_buffer(), deadline)
            if count < 0:
                return False
            if count == 0:
                self._lost(self._ended())
            else:
                self._conversation.buffer_updated(count)
        except ProtocolError as e:
            self._lost(e)
        except OSError as e:
            self._lost(self._broke(e))
        return True

    def _lost(self, error: Error) -> None:
        self._note_loss(error)
        if self._link is not None:
            self._link.close()
        self._link = None

    def _open(self, deadline: float) -> None:
        """Connects and subscribes as before."""
        self._conversation = self._conversation.successor()
        try:
            try:
                self._link = Link(self._address, deadline, self._tls, self._check_pin)
            except ConnectionError:
                raise
            except OSError as e:
                raise self._cannot_connect(e) from e
            self._local = self._link.local
            server = self._exchange(self._hello(), deadline)
            self._server = server
            if self._subscription is not None:
                self._exchange(self._subscribe_request(self._subscription, again=True), deadline)
        except BaseException as e:  # Ctrl-C too: the link would stay open, without a subscription.
            self._lost(e if isinstance(e, Error) else ConnectionError(
                f"connecting to {self._address} was given up"))
            self._note_failure()
            raise
        self._note_return()
