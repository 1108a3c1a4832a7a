"""What the waiting and the asyncio client have in common: everything but input and output."""
from __future__ import annotations

import hashlib
import hmac
import ssl
from pathlib import Path

from . import requests
from .address import DEFAULT_HOST, Address, parse
from .errors import UNSUPPORTED, ConnectionError, Denied, Error, ProtocolError, Unsupported, refusal
from .protocol import Conversation
from .recording import Recording
from .requests import Request, T
from .subscription import Subscription
from .values import Server, Status

#: Calibrations take the daemon seconds.
_SLOW_S = 30.0
#: Between two attempts to connect again: from, to.
BACK_OFF_S = (0.1, 5.0)


class Session:
    """A connection to dtactd.

    :param address: "host", "host:port", "unix:/path"; port 7377 unless given.
    :param token: what the daemon asks for on an address beyond its machine. It is sent only to
        this machine and to a daemon whose certificate is pinned by `fingerprint`.
    :param token_file: the same from the first line of a file.
    :param fingerprint: SHA-256 of the daemon's certificate in hexadecimal, as `dtactctl cert`
        prints it: TLS, and nobody else is spoken to.
    :param program: shown by `dtactctl status`.
    :param timeout: seconds for the connection, each request, and each frame.
    :param reconnect: connect and subscribe again when the connection breaks while frames or events
        are awaited. A request that is under way then fails with ConnectionError.
    :param kept_frames: frames kept while nobody takes them, the newest; 1: always the newest.
    """

    def __init__(
        self,
        address: str = DEFAULT_HOST,
        *,
        token: str | None = None,
        token_file: str | Path | None = None,
        fingerprint: str | None = None,
        program: str = "dtact Python client",
        timeout: float = 5.0,
        reconnect: bool = False,
        kept_frames: int = 4,
    ) -> None:
        if token is not None and token_file is not None:
            raise ValueError("give a token or a token_file, not both")
        if kept_frames < 1:
            raise ValueError("kept_frames has to be 1 or more")
        if token_file is not None:
            lines = Path(token_file).read_text().splitlines()
            token = lines[0].strip() if lines else ""
        self._address: Address = parse(address)
        self._token = token
        self._pin = None if fingerprint is None else _plain(fingerprint)
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
        or stop(). `dtactctl record` does it, over a connection of its own."""
        return Recording(path, self._address, self._token, self._pin)

    def __repr__(self) -> str:
        state = self._server.program if self._server else "not connected"
        return f"<dtact client of {self._address}: {state}>"

    # ------------------------------------------------------------ for the clients

    def _hello(self) -> Request[Server]:
        """The first request on a new connection, whose `_local` is known."""
        if self._token is not None and not (self._local or self._pin is not None):
            raise Error(f"the token is not sent to {self._address}: nothing says who listens there. "
                        "Give the fingerprint of the daemon's certificate (dtactctl cert)")
        return requests.hello(self._program, self._token)

    def _prepare(self, request: Request[T]) -> tuple[int, bytes]:
        """The number and bytes of a request. Unsupported for one that the daemon is too old for."""
        if self._server is not None:
            missing = sorted(request.needs - self._server.features)
            if missing:
                raise Unsupported(UNSUPPORTED, f"{self._server.program} on {self._address} does not "
                                  f"know {', '.join(missing)}: update dtactd")
        return self._conversation.request(request.message)

    def _has_answer(self, number: int) -> bool:
        return number in self._conversation.answers

    def _answer(self, number: int, request: Request[T]) -> T:
        """The answer, which is there. The daemon's refusal is raised."""
        reply = self._conversation.answers.pop(number)
        if reply.HasField("error"):
            raise refusal(reply.error.code, reply.error.message)
        return request.answer(reply)

    def _check_usable(self) -> None:
        """Without a connection: raises why, unless another one may be made."""
        if not self._reconnect or isinstance(self._broken, ProtocolError | Denied):
            raise self._broken

    def _patience(self, request: Request[T]) -> float:
        return max(self._timeout, _SLOW_S) if request.slow else self._timeout

    def _subscribe_request(self, subscription: Subscription | None) -> Request[None]:
        if subscription is None:
            return requests.unsubscribe()
        return requests.subscribe(subscription, self.server.features)

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
        if isinstance(error, ssl.SSLError):
            return ConnectionError(f"{name} does not speak TLS ({error}): without a fingerprint no "
                                   "TLS is used; dtactctl status shows the daemon's addresses")
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

    def _tls_context(self) -> ssl.SSLContext:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        # Daemons sign their certificates themselves: the pin says whose it is, not an authority.
        context.check_hostname = False
        context.verify_mode = ssl.CERT_NONE
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        return context

    def _check_pin(self, certificate: bytes | None) -> None:
        """ProtocolError for another certificate (DER) than the pinned one."""
        found = hashlib.sha256(certificate or b"").hexdigest()
        if self._pin is not None and not hmac.compare_digest(found, self._pin):
            raise ProtocolError(f"{self._address} has another certificate than the pinned one: its "
                                f"fingerprint is {found}. If the daemon got a new one (dtactctl "
                                "cert), pin that; else somebody stands between")


def _plain(fingerprint: str) -> str:
    plain = fingerprint.replace(":", "").strip().lower()
    if len(plain) != 64 or any(c not in "0123456789abcdef" for c in plain):
        raise ValueError("a fingerprint has 64 hexadecimal digits (SHA-256), as dtactctl cert "
                         "prints it")
    return plain
