"""A WebSocket client (RFC 6455) in Python's standard library, as far as the tests need one."""
import base64
import hashlib
import os
import socket
import ssl
import struct
import time
from typing import Optional

TIMEOUT = 30.0  # seconds, for messages that come without a request
TEXT, BINARY, CLOSE, PING, PONG = 1, 2, 8, 9, 10
GUID = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11"


class Refused(Exception):
    """The server did not open a WebSocket; `status` is HTTP's."""

    def __init__(self, status: int, body: str) -> None:
        super().__init__(f"{status}: {body}")
        self.status, self.body = status, body


class Closed(Exception):
    """The server ended the connection; `code` is the WebSocket's, or 0 where it said none."""

    def __init__(self, code: int) -> None:
        super().__init__(f"closed with {code}")
        self.code = code


def connect(port: int, tls: Optional[ssl.SSLContext] = None) -> socket.socket:
    plain = socket.create_connection(("127.0.0.1", port), timeout=TIMEOUT)
    plain.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return tls.wrap_socket(plain, server_hostname="localhost") if tls else plain


def read_head(stream: socket.socket) -> tuple[int, dict[str, str], bytes]:
    """Status, fields by their names in small letters, and what was read beyond the head."""
    data = b""
    while b"\r\n\r\n" not in data:
        chunk = stream.recv(4096)
        if not chunk:
            raise Closed(0)
        data += chunk
    head, rest = data.split(b"\r\n\r\n", 1)
    lines = head.decode("latin-1").split("\r\n")
    fields = dict(line.split(": ", 1) for line in lines[1:])
    return int(lines[0].split(" ")[1]), {k.lower(): v for k, v in fields.items()}, rest


def request(port: int, target: str, method: str = "GET", body: bytes = b"",
            tls: Optional[ssl.SSLContext] = None, **fields: str) -> tuple[int, dict[str, str], bytes]:
    """One request of HTTP on a connection of its own: status, fields, body."""
    lines = {"Host": f"127.0.0.1:{port}", "Connection": "close"}
    lines.update({name.replace("_", "-"): value for name, value in fields.items()})
    if body:
        lines["Content-Length"] = str(len(body))
    text = f"{method} {target} HTTP/1.1\r\n" + "".join(f"{k}: {v}\r\n" for k, v in lines.items())
    with connect(port, tls) as stream:
        stream.sendall(text.encode() + b"\r\n" + body)
        status, answer, rest = read_head(stream)
        while chunk := stream.recv(65536):
            rest += chunk
        return status, answer, rest


class WebSocket:
    def __init__(self, port: int, target: str, tls: Optional[ssl.SSLContext] = None,
                 receive_buffer: int = 0, **fields: str) -> None:
        self.stream = connect(port, tls)
        if receive_buffer:
            self.stream.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        key = base64.b64encode(os.urandom(16)).decode()
        lines = {"Host": f"127.0.0.1:{port}", "Upgrade": "websocket", "Connection": "Upgrade",
                 "Sec-WebSocket-Key": key, "Sec-WebSocket-Version": "13"}
        lines.update({name.replace("_", "-"): value for name, value in fields.items()})
        text = f"GET {target} HTTP/1.1\r\n" + "".join(f"{k}: {v}\r\n" for k, v in lines.items())
        self.stream.sendall(text.encode() + b"\r\n")
        status, self.fields, rest = read_head(self.stream)
        self.buffer = bytearray(rest)
        if status != 101:
            while chunk := self.stream.recv(65536):
                self.buffer += chunk
            self.close()
            raise Refused(status, self.buffer.decode())
        accept = base64.b64encode(hashlib.sha1((key + GUID).encode()).digest()).decode()
        assert self.fields["sec-websocket-accept"] == accept

    def __enter__(self) -> "WebSocket":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self.stream.close()

    def send(self, payload: bytes, opcode: int = BINARY, masked: bool = True,
             announced: Optional[int] = None) -> None:
        """Sends one message in one frame. `announced`: a length other than its own."""
        size = len(payload) if announced is None else announced
        head = bytes([0x80 | opcode])
        flag = 0x80 if masked else 0
        if size < 126:
            head += bytes([flag | size])
        elif size < 65536:
            head += bytes([flag | 126]) + struct.pack(">H", size)
        else:
            head += bytes([flag | 127]) + struct.pack(">Q", size)
        if masked:
            # A mask of zeros leaves the payload as it is.
            head += bytes(4)
        self.stream.sendall(head + payload)

    def _take(self, size: int, until: float) -> bytes:
        while len(self.buffer) < size:
            left = until - time.monotonic()
            if left <= 0:
                raise TimeoutError("nothing came")
            self.stream.settimeout(left)
            try:
                chunk = self.stream.recv(1 << 18)
            except ConnectionResetError:
                chunk = b""
            if not chunk:
                raise Closed(0)
            self.buffer += chunk
        taken = bytes(self.buffer[:size])
        del self.buffer[:size]
        return taken

    def receive(self, seconds: float = TIMEOUT) -> tuple[int, bytes]:
        """The next message, TEXT or BINARY. The server sends each in one frame."""
        until = time.monotonic() + seconds
        while True:
            first, second = self._take(2, until)
            assert first & 0x70 == 0, "no extension was agreed on"
            assert second & 0x80 == 0, "a server masks nothing"
            size = second & 0x7F
            if size == 126:
                (size,) = struct.unpack(">H", self._take(2, until))
            elif size == 127:
                (size,) = struct.unpack(">Q", self._take(8, until))
            payload = self._take(size, until)
            opcode = first & 0x0F
            if opcode == CLOSE:
                raise Closed(struct.unpack(">H", payload[:2])[0] if payload else 0)
            if opcode == PING:
                self.send(payload, PONG)
                continue
            if opcode == PONG:
                continue
            assert first & 0x80, "each message is one frame"
            return opcode, payload
