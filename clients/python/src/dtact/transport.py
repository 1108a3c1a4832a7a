"""A connected socket, with deadlines."""
from __future__ import annotations

import ipaddress
import math
import socket
import ssl
import sys
import time
from typing import Callable

from .address import Address


def is_local(sock: socket.socket) -> bool:
    """The other end is on this machine."""
    if sock.family == socket.AF_UNIX:
        return True
    remote = sock.getpeername()[0].partition("%")[0]
    address = ipaddress.ip_address(remote)
    mapped = getattr(address, "ipv4_mapped", None)
    return (mapped or address).is_loopback or remote == sock.getsockname()[0].partition("%")[0]


# What the kernel keeps of a stream for one that reads late, bytes. Left to itself it keeps megabytes: to
# one slower than the frames every frame, and every answer, would come that much late.
_UNREAD = 256 * 1024


def tune(sock: socket.socket) -> None:
    """Requests go at once, what comes is not kept for long, and a daemon whose machine is gone is noticed
    within half a minute."""
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _UNREAD)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    if sys.platform == "linux":
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 10)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 5)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 4)


def _left(deadline: float) -> float:
    """Seconds until then. TimeoutError when it has passed."""
    left = deadline - time.monotonic()
    if left <= 0:
        raise TimeoutError("timed out")
    return left


def _connected(address: Address, deadline: float) -> socket.socket:
    if address.path:
        sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            sock.settimeout(_left(deadline))
            sock.connect(address.path)
        except OSError:
            sock.close()
            raise
        return sock
    sock = socket.create_connection((address.host, address.port), _left(deadline))
    tune(sock)
    return sock


class Link:
    """OSErrors go to the caller; TimeoutError is one. Looking a name up is not bounded by the
    deadline."""

    def __init__(self, address: Address, deadline: float, tls: ssl.SSLContext | None,
                 check: Callable[[bytes | None], None]) -> None:
        sock = _connected(address, deadline)
        try:
            self.local = is_local(sock)
            if tls is not None:
                sock.settimeout(_left(deadline))
                sock = tls.wrap_socket(sock, server_hostname=address.host)
                check(sock.getpeercert(binary_form=True))
        except BaseException:
            sock.close()
            raise
        self._socket = sock

    def send(self, data: bytes, deadline: float) -> None:
        """All of it. What the other side no longer takes is lost: its reason may lie unread."""
        try:
            self._socket.settimeout(_left(deadline))
            self._socket.sendall(data)
        except (BrokenPipeError, ConnectionResetError, ssl.SSLEOFError):
            pass

    def receive(self, buffer: memoryview, deadline: float | None) -> int:
        """How many bytes came; -1 when none came in time (without a deadline: lay ready), 0 at the
        end of the connection. math.inf waits without an end."""
        wait = 0.0 if deadline is None else max(0.0, deadline - time.monotonic())
        self._socket.settimeout(None if wait == math.inf else wait)
        try:
            return self._socket.recv_into(buffer)
        except (BlockingIOError, TimeoutError, ssl.SSLWantReadError):
            return -1
        except (ConnectionResetError, ssl.SSLEOFError):
            return 0

    def close(self) -> None:
        self._socket.close()
