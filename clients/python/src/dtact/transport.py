"""A connected socket, with deadlines."""
from __future__ import annotations

import errno
import ipaddress
import math
import os
import selectors
import socket
import ssl
import sys
import time
from typing import Any, Callable, cast

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
    sock = _first_connected(
        socket.getaddrinfo(address.host, address.port, type=socket.SOCK_STREAM), deadline)
    tune(sock)
    return sock


#: How long an address is tried alone before the next one is tried beside it (RFC 8305, section 5).
ATTEMPT_DELAY_S = 0.25


def _first_connected(addresses: list[Any], deadline: float) -> socket.socket:
    """The first of getaddrinfo()'s addresses that a connection is made to. One that stays silent does
    not keep the next one from being tried."""
    error: OSError = TimeoutError("timed out")
    next_due = 0.0
    with selectors.DefaultSelector() as attempts:
        try:
            while addresses or attempts.get_map():
                now = time.monotonic()
                if now >= deadline:
                    break
                if addresses and (now >= next_due or not attempts.get_map()):
                    next_due = now + ATTEMPT_DELAY_S
                    try:
                        attempts.register(_begun(*addresses.pop(0)), selectors.EVENT_WRITE)
                    except OSError as e:
                        error, next_due = e, 0.0
                    continue
                until = min(deadline, next_due) if addresses else deadline
                for key, _ in attempts.select(until - now):
                    sock = cast(socket.socket, key.fileobj)
                    attempts.unregister(sock)
                    failure = sock.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
                    if failure == 0:
                        return sock
                    sock.close()
                    error, next_due = OSError(failure, os.strerror(failure)), 0.0
        finally:
            for key in attempts.get_map().values():
                cast(socket.socket, key.fileobj).close()
    raise error


def _begun(family: int, kind: int, protocol: int, _: str, target: Any) -> socket.socket:
    """A socket that is connecting, or connected. OSError when that cannot be."""
    sock = socket.socket(family, kind, protocol)
    sock.setblocking(False)
    failure = sock.connect_ex(target)
    if failure not in (0, errno.EINPROGRESS):
        sock.close()
        raise OSError(failure, os.strerror(failure))
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
        except TimeoutError as e:
            # With a number it is the kernel's: the other side has gone without a word.
            if e.errno is not None:
                raise
            return -1
        except (BlockingIOError, ssl.SSLWantReadError):
            return -1
        except (ConnectionResetError, ssl.SSLEOFError):
            return 0

    def close(self) -> None:
        self._socket.close()
