"""A client of the daemon's wire over a WebSocket, like the page."""
import collections
import json
import struct
import time
from typing import Any, Callable, Protocol

from messages import E, M
from web_socket import BINARY, TIMEOUT, TEXT, WebSocket, connect

__all__ = ["Client", "Conversation", "E", "M", "Viewer", "length"]


def length(size: int) -> bytes:
    return struct.pack(">I", size)


class Link(Protocol):
    """Transport of the wire: each message with its length."""

    def send(self, payload: bytes) -> None: ...
    def receive(self, seconds: float) -> tuple[int, bytes]: ...
    def close(self) -> None: ...


class TcpLink:
    """The daemon's own port."""

    def __init__(self, port: int) -> None:
        self.stream = connect(port)
        self.file = self.stream.makefile("rb")

    def send(self, payload: bytes) -> None:
        self.stream.sendall(payload)

    def receive(self, seconds: float) -> tuple[int, bytes]:
        self.stream.settimeout(seconds)
        head = self.file.read(4)
        return BINARY, head + self.file.read(int.from_bytes(head, "big"))

    def close(self) -> None:
        self.stream.close()


class Conversation:
    """Sorts the messages: `frames`, `events`, `replies` by id, `reported` by the gateway itself."""

    def __init__(self, link: Link, token: str = "", greet: bool = True) -> None:
        self.link = link
        self.frames: collections.deque[Any] = collections.deque()
        self.events: collections.deque[Any] = collections.deque()
        self.reported: collections.deque[Any] = collections.deque()
        self.replies: dict[int, Any] = {}
        self.next_id = 1
        if greet:
            self.hello = self.call(hello=M.Hello(major=1, minor=1, program="test", token=token)).hello

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None:
        self.link.close()

    def ask(self, **what: Any) -> int:
        number = self.next_id
        self.next_id += 1
        body = M.ClientMessage(id=number, **what).SerializeToString()
        self.link.send(length(len(body)) + body)
        return number

    def sort(self, seconds: float = TIMEOUT) -> None:
        """Reads one message."""
        opcode, payload = self.link.receive(seconds)
        if opcode == TEXT:
            self.reported.append(json.loads(payload))
            return
        assert struct.unpack(">I", payload[:4]) == (len(payload) - 4,), "one message, framed"
        message = M.ServerMessage.FromString(payload[4:])
        kind = message.WhichOneof("body")
        if kind == "frame":
            self.frames.append(message.frame)
        elif kind == "event":
            self.events.append(message.event)
        else:
            assert message.reply.id not in self.replies, "each request gets exactly one reply"
            self.replies[message.reply.id] = message.reply

    def until(self, done: Callable[[], Any], what: str) -> Any:
        """Reads messages until `done` returns a value."""
        end = time.monotonic() + TIMEOUT
        while not (found := done()):
            assert time.monotonic() < end, f"{what} within {TIMEOUT} s"
            self.sort(max(0.01, end - time.monotonic()))
        return found

    def answer(self, number: int) -> Any:
        return self.until(lambda: self.replies.pop(number, None), f"an answer to {number}")

    def call(self, **what: Any) -> Any:
        """The reply, which must not be an error."""
        reply = self.answer(self.ask(**what))
        assert reply.WhichOneof("result") != "error", reply
        return reply

    def refused(self, **what: Any) -> Any:
        """The error in the reply to a request."""
        reply = self.answer(self.ask(**what))
        assert reply.WhichOneof("result") == "error", reply
        return reply.error

    def frame(self, where: Callable[[Any], bool] = lambda frame: True) -> Any:
        def next_one() -> Any:
            while self.frames:
                frame = self.frames.popleft()
                if where(frame):
                    return frame
            return None
        return self.until(next_one, "a frame")

    def notice(self, where: Callable[[Any], bool]) -> Any:
        """The gateway's report about its daemon."""
        def next_one() -> Any:
            while self.reported:
                reported = self.reported.popleft()
                if where(reported):
                    return reported
            return None
        return self.until(next_one, "a notice")


class Viewer(Conversation):
    """A client of dtact-web."""

    def __init__(self, port: int, sensor: str = "left", token: str = "", greet: bool = True,
                 **options: Any) -> None:
        self.socket = WebSocket(port, f"/sensors/{sensor}/wire", **options)
        super().__init__(self.socket, token, greet)


class Client(Conversation):
    """A client of dtactd."""

    def __init__(self, port: int) -> None:
        super().__init__(TcpLink(port))
