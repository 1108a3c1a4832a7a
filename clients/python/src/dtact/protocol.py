"""The protocol with a daemon, without I/O: bytes in, bytes out.

The caller reads into get_buffer() and reports the count to buffer_updated(), as with asyncio's
BufferedProtocol. Answers, frames and events can then be taken."""
from __future__ import annotations

from collections import deque
from typing import Generic, TypeVar

from google.protobuf.message import DecodeError

from .errors import EndedByDaemon, Error, ProtocolError, refusal
from .event import Event, event_of
from .frame import Frame
from .messages import Message, ServerMessage

#: Longest message either way, bytes.
MAX_BYTES = 16 << 20
#: Events kept until they are taken; beyond it the oldest are dropped.
MAX_EVENTS = 100_000

_T = TypeVar("_T")


class _Numbered(Generic[_T]):
    """The newest few of what came, with the number in the order of arrival."""

    def __init__(self, most: int) -> None:
        self._items: deque[tuple[int, _T]] = deque(maxlen=most)

    def put(self, number: int, item: _T) -> None:
        self._items.append((number, item))

    def first(self) -> int | None:
        return self._items[0][0] if self._items else None

    def take(self) -> _T | None:
        return self._items.popleft()[1] if self._items else None

    def clear(self) -> None:
        self._items.clear()


class Conversation:
    """One connection's: framing, the numbers of requests, and what came and was not taken yet:
    every event, and the newest few frames."""

    def __init__(self, kept_frames: int) -> None:
        self._kept_frames = kept_frames
        self._head = bytearray(4)
        self._part: bytearray = self._head  # What is being received: the length or the message.
        self._filled = 0
        self._next_id = 1
        self._waiting: set[int] = set()
        self._subscribing = 0  # The number of the last request to subscribe otherwise than before.
        self._arrivals = 0
        self._frames: _Numbered[Frame] = _Numbered(kept_frames)
        self._events: _Numbered[Event] = _Numbered(MAX_EVENTS)
        #: Answers not taken yet, by the request's number.
        self.answers: dict[int, Message] = {}
        #: Why the daemon ends the connection, once it has said so.
        self.farewell: Error | None = None
        #: Sequence of the last frame received; 0: none.
        self.last_sequence = 0

    def successor(self) -> Conversation:
        """The conversation for the next connection; it keeps the frames and events not taken yet."""
        other = Conversation(self._kept_frames)
        other._arrivals = self._arrivals
        other._frames = self._frames
        other._events = self._events
        other.last_sequence = self.last_sequence
        return other

    def tell(self, event: Event) -> None:
        """Adds an event of the client itself."""
        self._arrivals += 1
        self._events.put(self._arrivals, event)

    # ------------------------------------------------------------ out

    def request(self, message: Message, again: bool = False) -> tuple[int, bytes]:
        """Its number, and the bytes to send. `again`: it subscribes as before, and frames not taken
        yet are kept. ValueError for one that is too long."""
        number = self._next_id
        message.id = number
        body = message.SerializeToString()
        if len(body) > MAX_BYTES:
            raise ValueError(f"the request has {len(body)} bytes, at most {MAX_BYTES} can be sent")
        self._next_id += 1
        self._waiting.add(number)
        if message.HasField("subscribe") and not again:
            self._subscribing = number
        return number, len(body).to_bytes(4, "big") + body

    def forget(self, number: int) -> None:
        """Discards the answer to this request."""
        self._waiting.discard(number)
        self.answers.pop(number, None)

    # ------------------------------------------------------------ in

    def get_buffer(self) -> memoryview:
        """Where the next bytes go; never empty."""
        return memoryview(self._part)[self._filled :]

    def buffer_updated(self, count: int) -> None:
        """Takes `count` bytes from the buffer. ProtocolError when they are no daemon's message."""
        self._filled += count
        if self._filled < len(self._part):
            return
        self._filled = 0
        if self._part is not self._head:
            body, self._part = self._part, self._head
            self._message(bytes(body))
            return
        length = int.from_bytes(self._head, "big")
        if length > MAX_BYTES:
            raise ProtocolError(f"a length of {length} bytes was received: that is no dtactd, or "
                                "one of another version")
        if length == 0:
            self._message(b"")
        else:
            self._part = bytearray(length)

    def _message(self, body: bytes) -> None:
        message = ServerMessage()
        try:
            message.ParseFromString(body)
        except DecodeError as e:
            raise ProtocolError("the answer was no dtact message: is there another program on this "
                                "port?") from e
        self._arrivals += 1
        kind = message.WhichOneof("body")
        if kind == "frame":
            self.last_sequence = message.frame.sequence
            self._frames.put(self._arrivals, Frame(message.frame))
        elif kind == "event":
            event = event_of(message.event)
            if event is not None:
                self._events.put(self._arrivals, event)
        elif kind == "reply":
            self._reply(message.reply)

    def _reply(self, reply: Message) -> None:
        if reply.id == 0 and reply.HasField("error"):
            error = refusal(reply.error.code, reply.error.message)
            is_version = isinstance(error, ProtocolError)
            self.farewell = error if is_version else EndedByDaemon(reply.error.code, str(error))
        elif reply.id in self._waiting:
            self._waiting.discard(reply.id)
            self.answers[reply.id] = reply
            if reply.id == self._subscribing and not reply.HasField("error"):
                self._frames.clear()  # What comes from here on is as was asked last.

    # ------------------------------------------------------------ taken

    def take_frame(self) -> Frame | None:
        """The first frame not taken yet, if there is one."""
        return self._frames.take()

    def take_event(self) -> Event | None:
        """The first event not taken yet, if there is one."""
        return self._events.take()

    def take(self) -> Frame | Event | None:
        """Whichever came first."""
        frame, event = self._frames.first(), self._events.first()
        if frame is None or (event is not None and event < frame):
            return self._events.take()
        return self._frames.take()
