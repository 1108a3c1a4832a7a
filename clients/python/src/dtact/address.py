"""Where a daemon listens, as users write it."""
from __future__ import annotations

from dataclasses import dataclass

DEFAULT_HOST = "127.0.0.1"
DEFAULT_PORT = 7377  # kDefaultPort of proto/defaults.hpp


@dataclass(frozen=True)
class Address:
    """A TCP host and port, or the path of a Unix socket."""

    host: str = DEFAULT_HOST
    port: int = DEFAULT_PORT
    path: str = ""  # of a Unix socket; empty: TCP

    def __str__(self) -> str:
        return self.path or f"{self.host} port {self.port}"


def parse(text: str) -> Address:
    """ "gripper", "gripper:7378", "192.168.1.5", "::1", "[::1]:7378", "unix:/run/dtactd/dtactd.sock".
    ValueError for what is none of these."""
    if text.startswith("unix:"):
        path = text.removeprefix("unix:")
        if not path:
            raise ValueError('"unix:" needs the path of the socket after it')
        return Address(host="", port=0, path=path)
    host, port = text, ""
    if text.startswith("["):
        host, bracket, rest = text[1:].partition("]")
        if not bracket or (rest and not rest.startswith(":")):
            raise ValueError(f'"{text}" is no address: an IPv6 one with a port is "[::1]:7377"')
        port = rest[1:]
    elif text.count(":") == 1:
        host, _, port = text.partition(":")
    if not host or (text.endswith(":") and not port and text.count(":") == 1):
        raise ValueError(f'"{text}" is no address: write "host", "host:port" or "unix:/path"')
    if ":" not in host:
        try:
            host.encode("idna")  # As connecting does, where the error would not name the host.
        except UnicodeError as e:
            raise ValueError(f'"{host}" is no name of a host: each part between dots has 1 to 63 '
                             "characters") from e
    if not port:
        return Address(host)
    if not port.isascii() or not port.isdigit() or not 1 <= int(port) <= 65535:
        raise ValueError(f'"{port}" is no port: 1 … 65535')
    return Address(host, int(port))
