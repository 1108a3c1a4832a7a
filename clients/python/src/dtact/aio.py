"""The asyncio client:

    async with dtact.aio.connect("gripper") as s:
        async for frame in s.frames():
            ...

Frames and events are kept until they are taken, as in the blocking client. Several tasks may share
one client; each frame goes to one of them.
"""
from __future__ import annotations

import asyncio
import builtins
import errno
import re
import threading
import time
from collections.abc import AsyncIterator, Callable, Sequence
from types import TracebackType
from typing import TypeVar

from . import requests
from .errors import ConnectionError, Error, NoFrame, ProtocolError, SharedClient, TimeoutError
from .event import Event
from .frame import Frame
from .protocol import Conversation
from .requests import Request, T
from .session import Session
from .subscription import Subscription
from .transport import ATTEMPT_DELAY_S, is_local, tune
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

#: Turns of the loop to read what lies ready: the newest frames count, and calls have to end.
_MAX_TURNS = 4096


def _common(error: OSError) -> OSError:
    """asyncio puts what several addresses of a host said into one text. The refusal, where all refused."""
    codes: list[str] = re.findall(r"\[Errno (\d+)\]", str(error)) if error.errno is None else []
    if codes and all(int(code) == errno.ECONNREFUSED for code in codes):
        return ConnectionRefusedError(errno.ECONNREFUSED, str(error))
    return error


class _Link(asyncio.BufferedProtocol):
    """Feeds received bytes to the conversation and wakes its waiters."""

    def __init__(self, conversation: Conversation) -> None:
        self._conversation = conversation
        self._waiters: set[asyncio.Future[None]] = set()
        self._error: Error | None = None
        self.reads = 0
        self.transport: asyncio.Transport | None = None
        self.open = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        self.open = True

    def get_buffer(self, sizehint: int) -> memoryview:
        return self._conversation.get_buffer()

    def buffer_updated(self, nbytes: int) -> None:
        self.reads += 1
        try:
            self._conversation.buffer_updated(nbytes)
        except ProtocolError as e:
            self._error = e
            self.close()
        self._wake()

    def connection_lost(self, exc: Exception | None) -> None:
        self.open = False
        self._wake()

    def reason(self) -> Error | None:
        """What was wrong with what came, if that ended the connection."""
        return self._error

    def close(self) -> None:
        self.open = False
        if self.transport is not None:
            self.transport.close()

    def _wake(self) -> None:
        for waiter in self._waiters:
            if not waiter.done():
                waiter.set_result(None)

    async def catch_up(self) -> None:
        """Until all that lies ready is read. A task that computes for long keeps the loop from reading."""
        for _ in range(_MAX_TURNS):
            before = self.reads
            # The loop reads behind the callbacks of the turn in which it finds that it can.
            await asyncio.sleep(0)
            await asyncio.sleep(0)
            if self.reads == before:
                return

    async def changed(self) -> None:
        """Until more came or the connection ended."""
        waiter = asyncio.get_running_loop().create_future()
        self._waiters.add(waiter)
        try:
            await waiter
        finally:
            self._waiters.discard(waiter)


class Client(Session):
    __doc__ = (Session.__doc__ or "").replace("A connection", "An asyncio connection", 1)

    _link: _Link | None = None
    #: Connects and subscribes, while that is under way.
    _opening: asyncio.Task[None] | None = None
    #: The first that it is used in.
    _loop: asyncio.AbstractEventLoop | None = None
    _closed = False

    async def __aenter__(self) -> Client:
        self._check_loop()
        if self._closed:
            raise self._broken
        try:
            await self._ensure_open()
        except asyncio.CancelledError:
            await self.close()  # There will be no __aexit__.
            raise
        return self

    async def __aexit__(self, kind: type[BaseException] | None, error: BaseException | None,
                        trace: TracebackType | None) -> None:
        await self.close()

    async def close(self) -> None:
        """Ends the connection. It cannot be used again."""
        self._closed = True
        self._reconnect = False
        if self._opening is not None:
            self._opening.cancel()
            await asyncio.wait([self._opening])
        self._lost(ConnectionError(f"the connection to {self._address} was closed"))
        await asyncio.sleep(0)  # The transport closes its socket in the loop's next turn.

    # ------------------------------------------------------------ frames and events

    async def subscribe(self, subscription: Subscription | None = Subscription()) -> None:
        """Replaces what is sent from now on; None ends it. Frames that came before are dropped:
        what frames() gives is as was asked last."""
        await self._ask(self._subscribe_request(subscription))
        self._subscription = subscription

    async def frames(self, timeout: float | None = None) -> AsyncIterator[Frame]:
        """Yields frames without end. Subscribes to depth if nothing is subscribed. A slow reader gets
        the newest frame each time, or with `kept_frames` the oldest of those kept. Raises NoFrame when
        none arrives within `timeout` seconds (default: the client's timeout, or no limit with
        `reconnect`)."""
        if self._subscription is None:
            await self.subscribe()
        limit = timeout if timeout is not None or self._reconnect else self._timeout
        while True:
            frame = await self._wait(Conversation.take_frame, limit)
            if frame is None:
                raise NoFrame(self._no_frame(limit or 0, await self.status()))
            yield frame

    async def events(self, timeout: float | None = None) -> AsyncIterator[Event]:
        """One event after another, those from before included; ends when none comes within
        `timeout` seconds. Frames go on to be kept for frames()."""
        while (event := await self._wait(Conversation.take_event, timeout)) is not None:
            yield event

    async def next(self, timeout: float | None = None) -> Frame | Event | None:
        """The next frame or event as they came; None when none came within `timeout` seconds."""
        return await self._wait(Conversation.take, timeout)

    # ------------------------------------------------------------ requests: see dtact.Client

    async def status(self) -> Status:
        return await self._ask(requests.status())

    async def set_light(self, brightness: int | None = None, scheme: str | None = None,
                        leds: Sequence[tuple[int, int, int]] | None = None) -> Light:
        return await self._ask(requests.set_light(brightness, scheme, leds))

    async def set_camera(self, exposure_us: float | None = None,
                         gain: float | None = None) -> CameraSettings:
        return await self._ask(requests.set_camera(exposure_us, gain))

    async def set_reconstruction(self, resolution: str | None = None, sharpen: str | None = None,
                                 max_error_um: float | None = None) -> Reconstruction:
        return await self._ask(requests.set_reconstruction(resolution, sharpen, max_error_um))

    async def rezero(self, force: bool = False) -> None:
        await self._ask(requests.rezero(force))

    async def calibration(self, number: int | None = None) -> CalibrationFiles:
        return await self._ask(requests.calibration(number))

    async def calibrations(self) -> list[StoredCalibration]:
        return await self._ask(requests.calibrations())

    async def upload_calibration(self, files: CalibrationFiles) -> int:
        return await self._ask(requests.upload_calibration(files))

    async def activate_calibration(self, number: int) -> None:
        await self._ask(requests.activate_calibration(number))

    async def pin_calibration(self, number: int, pinned: bool = True) -> None:
        await self._ask(requests.pin_calibration(number, pinned))

    async def reference(self) -> ReferenceImage:
        return await self._ask(requests.reference())

    async def ping(self) -> Pong:
        return await self._ask(requests.ping(time.monotonic))

    # ------------------------------------------------------------ the connection

    def _check_loop(self) -> None:
        """SharedClient in another process or event loop, hence another thread, than before."""
        self._check_process()
        here = asyncio.get_running_loop()
        self._loop = self._loop or here
        if self._loop is not here:
            raise SharedClient("this client belongs to another event loop: make a client for each loop "
                               f"(this one runs in thread {threading.current_thread().name})")

    async def _ask(self, request: Request[T]) -> T:
        self._check_loop()
        while self._link is None or self._opening is not None:
            if self._opening is None:
                self._check_usable()
            await self._ensure_open()
        return await self._exchange(request)

    async def _exchange(self, request: Request[T]) -> T:
        number, data = self._prepare(request)
        # Another task may have both replaced while this one waits.
        link, conversation = self._link, self._conversation
        assert link is not None and link.transport is not None
        link.transport.write(data)
        try:
            async with asyncio.timeout(self._patience(request)):
                while number not in conversation.answers:
                    if not link.open:
                        if self._link is link:
                            self._lost(link.reason() or self._ended())
                        raise self._broken
                    await link.changed()
        except BaseException as e:  # A cancelled task's answer would be kept for ever.
            conversation.forget(number)
            if isinstance(e, builtins.TimeoutError) and not isinstance(e, Error):
                raise TimeoutError("the daemon gave no answer in time: look at journalctl -u dtactd") from e
            raise
        return self._answer(conversation.answers.pop(number), request)

    async def _wait(self, take: Callable[[Conversation], _Item | None],
                    limit: float | None) -> _Item | None:
        """What `take` finds once it finds something; None when that takes longer than `limit`."""
        self._check_loop()
        if self._link is not None and self._opening is None:
            await self._link.catch_up()
        try:
            async with asyncio.timeout(limit):
                while (item := take(self._conversation)) is None:
                    if self._opening is None:
                        if self._link is not None and self._link.open:
                            await self._link.changed()
                            continue
                        if self._link is not None:
                            self._lost(self._link.reason() or self._ended())
                        self._check_usable()
                        left = self._next_attempt - time.monotonic()
                        if left > 0:
                            await asyncio.sleep(left)
                            continue
                    try:
                        await self._ensure_open()
                    except ConnectionError:
                        pass  # Until the next attempt is due.
                return item
        except builtins.TimeoutError as e:
            if isinstance(e, Error):
                raise
            return None

    def _lost(self, error: Error) -> None:
        self._note_loss(error)
        if self._link is not None:
            self._link.close()
        self._link = None

    async def _ensure_open(self) -> None:
        """Opens a connection unless there is one. One opening serves all tasks, and goes on when
        they give up waiting for it."""
        if self._opening is None:
            if self._link is not None:
                return
            self._opening = asyncio.create_task(self._open())
            self._opening.add_done_callback(self._opened)
        opening = self._opening
        # Like asyncio.shield(), except that close(), which cancels the opening, spares the waiters.
        await asyncio.wait([opening])
        if opening.cancelled():
            raise self._broken
        opening.result()

    def _opened(self, opening: asyncio.Task[None]) -> None:
        self._opening = None
        if not opening.cancelled():
            opening.exception()  # Retrieved, else asyncio complains when no task waits any more.

    async def _open(self) -> None:
        """Connects and subscribes as before."""
        self._conversation = self._conversation.successor()
        try:
            try:
                async with asyncio.timeout(self._timeout):
                    self._link = await self._connected()
            except ConnectionError:
                raise
            except OSError as e:
                raise self._cannot_connect(_common(e)) from e
            server = await self._exchange(self._hello())
            self._server = server
            if self._subscription is not None:
                await self._exchange(self._subscribe_request(self._subscription, again=True))
        except BaseException as e:  # Cancellation too: the link would stay open.
            self._lost(e if isinstance(e, Error) else ConnectionError(
                f"connecting to {self._address} was given up"))
            self._note_failure()
            raise
        self._note_return()

    async def _connected(self) -> _Link:
        loop = asyncio.get_running_loop()
        address, conversation = self._address, self._conversation

        def make() -> _Link:
            return _Link(conversation)

        if address.path:
            transport, link = await loop.create_unix_connection(make, address.path)
        else:
            transport, link = await loop.create_connection(
                make, address.host, address.port, ssl=self._tls,
                happy_eyeballs_delay=ATTEMPT_DELAY_S, interleave=0)
        if self._tls is not None:
            try:
                self._check_pin(transport.get_extra_info("ssl_object").getpeercert(True))
            except Error:
                transport.close()
                raise
        sock = transport.get_extra_info("socket")
        self._local = is_local(sock)
        if not address.path:
            tune(sock)
        return link


#: `async with connect(...) as client`.
connect = Client
