"""What the waiting and the asyncio client have in common: everything but input and output."""
from __future__ import annotations

import hashlib
import hmac
import os
import random
import ssl
import stat
import time
from pathlib import Path

from . import requests
from .address import DEFAULT_HOST, Address, parse
from .errors import (
    ConnectionError,
    Denied,
    Error,
    IdentityError,
    ProtocolError,
    SharedClient,
    refusal,
)
from .event import Reconnected
from .messages import Message
from .protocol import Conversation
from .recording import Recording
from .requests import Request, T
from .subscription import Subscription
from .values import Server, Status

#: Calibrations take the daemon seconds.
_SLOW_S = 30.0
#: The slowest network over which a large request arrives in time: 1 Mbit/s.
_SLOWEST_BYTES_PER_S = 125_000
#: The longest wait between attempts to connect again. After a connection that lasted longer the waits
#: begin with the shortest.
_LONGEST_WAIT_S = 5.0
# What more attempts to connect do not fix.
_FINAL = (ProtocolError, IdentityError, Denied)
_MAX_TOKEN_BYTES = 256


class BackOff:
    """The waits between attempts to connect again, in seconds: 0.1, 0.2, … 5, less a random part of up
    to a half, so that the clients of a daemon do not all come at once."""

    def __init__(self) -> None:
        self._next = 0.1

    def next(self) -> float:
        wait = self._next * random.uniform(0.5, 1.0)
        self._next = min(2 * self._next, _LONGEST_WAIT_S)
        return wait


class Session:
    """A connection to dtactd.

    :param address: "host", "host:port", "unix:/path"; port 7377 unless given.
    :param token: the token that the daemon requires from other machines. It is sent only to this
        machine, to a daemon known by `fingerprint` or `ca_file`, or if `insecure` is set.
    :param token_file: the same from the first line of a file that only its owner may read.
    :param fingerprint: SHA-256 of the daemon's certificate in hexadecimal, as `dtactctl cert`
        prints it. Selects TLS 1.3; any other certificate is refused.
    :param ca_file: PEM file of CAs. Selects TLS 1.3; one of them must have signed the daemon's
        certificate for the host's name.
    :param insecure: sends the token over plain TCP to other machines too, where eavesdroppers can
        read and use it.
    :param program: shown by `dtactctl status`.
    :param timeout: seconds for the connection, each request, and each frame.
    :param reconnect: connect and subscribe again when the connection breaks while frames or events
        are awaited. A pending request then fails with ConnectionError.
    :param kept_frames: number of newest frames kept until they are taken. 1: a slow reader gets the
        newest frame only; more: a queue, from the oldest that is kept, of what comes while a call
        waits. Between calls nothing is read but by the asyncio client.
    """

    def __init__(
        self,
        address: str = DEFAULT_HOST,
        *,
        token: str | None = None,
        token_file: str | Path | None = None,
        fingerprint: str | None = None,
        ca_file: str | Path | None = None,
        insecure: bool = False,
        program: str = "dtact Python client",
        timeout: float = 5.0,
        reconnect: bool = False,
        kept_frames: int = 1,
    ) -> None:
        if token is not None and token_file is not None:
            raise ValueError("give a token or a token_file, not both")
        if kept_frames < 1:
            raise ValueError("kept_frames has to be 1 or more")
        self._address: Address = parse(address)
        self._token = token if token_file is None else read_token(Path(token_file))
        self._pin = None if fingerprint is None else _plain(fingerprint)
        # A socket file needs no TLS and uses none.
        tls = not self._address.path and (fingerprint is not None or ca_file is not None)
        self._tls = _tls_context(ca_file) if tls else None
        self._insecure = insecure
        self._options = [*_given("--token-file", token_file), *_given("--fingerprint", fingerprint),
                         *_given("--ca-file", ca_file), *(["--insecure"] if insecure else [])]
        self._program = program
        self._timeout = timeout
        self._reconnect = reconnect
        self._kept_frames = kept_frames
        self._conversation = Conversation(kept_frames)
        self._server: Server | None = None
        self._subscription: Subscription | None = None
        self._local = False
        #: Why there is no connection, while there is none.
        self._broken: Error = ConnectionError(f"not connected to {self._address}")
        self._lost_at: float | None = None
        self._lost_because = ""
        # Shared by all calls and tasks: polling with short time-outs does not shorten the back-off.
        self._back_off = BackOff()
        self._next_attempt = 0.0  # time.monotonic()
        self._opened_at = 0.0  # time.monotonic()
        self._process = os.getpid()
        self._begin()

    def _begin(self) -> None:
        """The waiting client connects at once."""

    # ------------------------------------------------------------ who

    @property
    def server(self) -> Server:
        """Who answered."""
        if self._server is None:
            raise self._broken
        return self._server

    @property
    def same_machine(self) -> bool:
        """The daemon runs on this machine, so that its CLOCK_MONOTONIC is time.monotonic()."""
        return self._local

    def record(self, path: str | Path) -> Recording:
        """Records all that the daemon gives into an MCAP file until the end of the `with` block,
        or stop(). `dtactctl record` does it, over a connection of its own. Returns once the first
        frame is recorded. Error when the file cannot be written or no frame comes within the
        client's timeout."""
        if self._token is not None and "--token-file" not in self._options:
            raise Error("give the token as a token_file: other users would see it in dtactctl's "
                        "command line")
        return Recording(path, self._address, self._options, self._timeout)

    def __repr__(self) -> str:
        state = self._server.program if self._server else "not connected"
        return f"<dtact client of {self._address}: {state}>"

    # ------------------------------------------------------------ for the clients

    def _check_process(self) -> None:
        if os.getpid() != self._process:
            raise SharedClient(f"process {self._process} made this client, and this is process "
                               f"{os.getpid()}: after a fork, make a client of its own there")

    def _hello(self) -> Request[Server]:
        """The first request on a new connection, whose `_local` is known."""
        if self._token is not None and not (self._local or self._tls or self._insecure):
            raise IdentityError(f"the token was not sent: {self._address} is another machine, and "
                                "over plain TCP any host on the way could read it. Give the fingerprint "
                                "of the daemon's certificate (dtactctl cert prints it)")
        return requests.hello(self._program, self._token)

    def _prepare(self, request: Request[T]) -> tuple[int, bytes]:
        """The number and bytes of a request."""
        return self._conversation.request(request.message, request.again)

    def _answer(self, reply: Message, request: Request[T]) -> T:
        """What the answer says. The daemon's refusal is raised."""
        if reply.HasField("error"):
            raise refusal(reply.error.code, reply.error.message)
        return request.answer(reply)

    def _check_usable(self) -> None:
        """Without a connection: raises why, unless another one may be made."""
        if not self._reconnect or isinstance(self._broken, _FINAL):
            raise self._broken

    def _note_loss(self, error: Error) -> None:
        self._broken = error
        if self._server is not None and self._lost_at is None:
            self._lost_at, self._lost_because = time.monotonic(), str(error)
            if self._lost_at - self._opened_at > _LONGEST_WAIT_S:
                self._back_off = BackOff()

    def _note_failure(self) -> None:
        """Records a failed attempt to connect."""
        self._next_attempt = time.monotonic() + self._back_off.next()

    def _note_return(self) -> None:
        """Adds a Reconnected event if there was a connection before."""
        self._opened_at = time.monotonic()
        if self._lost_at is not None:
            # A daemon that takes connections and ends them is not crowded either.
            self._next_attempt = self._opened_at + self._back_off.next()
            self._conversation.tell(Reconnected(
                self._conversation.last_sequence, None, None, self._lost_because,
                self._opened_at - self._lost_at))
        self._lost_at = None

    def _patience(self, request: Request[T]) -> float:
        if request.averages and self._server is not None:
            return self._timeout + self._server.rezero_timeout_s
        seconds = max(self._timeout, _SLOW_S) if request.slow else self._timeout
        size: int = request.message.ByteSize()
        return seconds + size / _SLOWEST_BYTES_PER_S

    def _subscribe_request(self, subscription: Subscription | None,
                           again: bool = False) -> Request[None]:
        if subscription is None:
            return requests.unsubscribe()
        return requests.subscribe(subscription, self._local, again)

    def _no_frame(self, seconds: float, status: Status) -> str:
        advice = status.advice or "Has what was subscribed a frame at all?"
        return (f"no frame came within {seconds:g} s; the daemon's state is {status.state}. "
                f"{advice}")

    # ------------------------------------------------------------ errors and TLS

    def _cannot_connect(self, error: OSError) -> ConnectionError:
        name = self._address
        if isinstance(error, ConnectionRefusedError | FileNotFoundError):
            return ConnectionError(f"nothing listens on {name}: is dtactd running (systemctl status "
                                   "dtactd), and is this its address?")
        if isinstance(error, ssl.SSLCertVerificationError):
            return IdentityError(f"{name} has no certificate that the ca_file vouches for: {error}")
        if isinstance(error, ssl.SSLError):
            return ConnectionError(f"{name} does not speak TLS ({error}): leave the fingerprint "
                                   "and the ca_file out if this daemon has no certificate")
        if isinstance(error, TimeoutError):
            return ConnectionError(f"{name} does not answer: check the address, the network and the "
                                   "firewall")
        return ConnectionError(f"cannot connect to {name}: {error}")

    def _broke(self, error: OSError) -> Error:
        if isinstance(error, TimeoutError):
            return ConnectionError(f"{self._address} takes no data: the daemon hangs or the network "
                                   "is down")
        return ConnectionError(f"the connection to {self._address} broke: {error}")

    def _ended(self) -> Error:
        """The other side closed the connection."""
        return self._conversation.farewell or ConnectionError(
            f"{self._address} ended the connection: dtactd was stopped, it let this client go "
            "(journalctl -u dtactd says why), or it expects TLS there"
        )

    def _check_pin(self, certificate: bytes | None) -> None:
        """IdentityError for another certificate (DER) than the pinned one."""
        found = hashlib.sha256(certificate or b"").hexdigest()
        if self._pin is not None and not hmac.compare_digest(found, self._pin):
            raise IdentityError(f"{self._address} has another certificate than the pinned one: its "
                                f"fingerprint is {found}. If the daemon got a new one, give "
                                "that; else somebody else answers there")


def _plain(fingerprint: str) -> str:
    plain = fingerprint.replace(":", "").strip().lower()
    if len(plain) != 64 or any(c not in "0123456789abcdef" for c in plain):
        raise ValueError("a fingerprint has 64 hexadecimal digits (SHA-256), as dtactctl cert "
                         "prints it")
    return plain


def _others(file: Path, status: os.stat_result) -> int:
    """The permissions that a token's file may not have. A credential (systemd.exec(5)) may be root's and
    readable by an access control list, whose mask its mode shows as the rights of root's group."""
    credentials = os.environ.get("CREDENTIALS_DIRECTORY")
    if credentials and file.parent == Path(credentials) and status.st_gid == 0:
        return stat.S_IRWXO
    return stat.S_IRWXG | stat.S_IRWXO


def read_token(file: Path) -> str:
    """The first line of a file. Error when it is no token or others may read it."""
    try:
        status = file.stat()
        lines = file.read_text().splitlines()
    except (OSError, UnicodeDecodeError) as e:
        raise Error(f"cannot read a token from {file}: {e}") from e
    if status.st_mode & _others(file, status):
        raise Error(f"{file} can be read by others: chmod 600 {file}")
    token = lines[0].rstrip() if lines else ""
    # The daemon's own file has lines like "control HASH NAME".
    if not 1 <= len(token.encode()) <= _MAX_TOKEN_BYTES or " " in token:
        raise Error(f"the first line of {file} is no token: it has 1 to {_MAX_TOKEN_BYTES} bytes "
                    "and no blanks. A line for the daemon has only its hash: the token is in "
                    "the file of dtactctl token -o")
    return token


def _tls_context(ca_file: str | Path | None) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    if ca_file is not None:
        try:
            context.load_verify_locations(cafile=ca_file)
        except OSError as e:
            raise Error(f"cannot read certificates from {ca_file}: {e}; it has to be a PEM file") from e
    else:
        # Daemons sign their certificates themselves: the fingerprint says whose it is.
        context.check_hostname = False
        context.verify_mode = ssl.CERT_NONE
    return context


def _given(option: str, value: str | Path | None) -> list[str]:
    return [] if value is None else [option, str(value)]
