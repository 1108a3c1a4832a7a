"""What goes wrong. The text of each error is a sentence for the user and names the fix."""
from __future__ import annotations

import builtins


class Error(Exception):
    """What all of the package's exceptions are."""


class ConnectionError(Error, builtins.ConnectionError):
    """No connection, or it broke. Without `reconnect` the client is of no further use."""


class TimeoutError(ConnectionError, builtins.TimeoutError):
    """The daemon did not answer a request in time. The connection stays; the answer is passed over
    when it comes."""


class ProtocolError(ConnectionError):
    """The other side does not speak this wire, or another version of it."""


class IdentityError(ConnectionError):
    """Not the daemon that `fingerprint` or `ca_file` ask for, or nothing that says so while a token
    is to be sent."""


class EndedByDaemon(ConnectionError):
    """The daemon ended the connection and said why: too many clients or requests, or one that it
    could not read."""

    #: The number of the ErrorCode in dtact.proto.
    code: int

    def __init__(self, code: int, sentence: str) -> None:
        super().__init__(sentence)
        self.code = code


class SharedClient(Error, RuntimeError):
    """A client is used by a second thread while another one is in a call, or by a process that was
    forked. Nothing was sent."""


class NoFrame(Error, builtins.TimeoutError):
    """No frame came in time. The connection goes on."""


class NotInFrame(Error, LookupError):
    """A frame does not hold what was asked of it: it was not subscribed or not measured."""


class Refused(Error):
    """The daemon refused a request. The connection goes on. The daemon's sentence is the text."""

    #: The number of the ErrorCode in dtact.proto.
    code: int

    def __init__(self, code: int, sentence: str) -> None:
        super().__init__(sentence)
        self.code = code


class Invalid(Refused, ValueError):
    """A field of the request is out of range; the sentence names it. Nothing has changed."""


class InContact(Refused):
    """Refused during contact."""


class DeviceFailed(Refused):
    """The ring or the camera failed."""


class Busy(Refused):
    """Too many commands wait, or too many clients: ask again."""


class Uncalibrated(Refused):
    """Needs a calibration."""


class StorageFailed(Refused):
    """The daemon's state directory could not be read or written."""


class Unsupported(Refused):
    """This program does not know the request, or a value in it: dtact-perceive, or an older dtactd."""


class Denied(Refused):
    """The token is missing or wrong, or its rights do not reach."""


# ErrorCode of dtact.proto.
_VERSION = 3
_TYPES: dict[int, type[Refused]] = {
    4: Invalid,
    5: InContact,
    6: DeviceFailed,
    7: Busy,
    8: Uncalibrated,
    9: StorageFailed,
    10: Unsupported,
    11: Denied,
}


def refusal(code: int, sentence: str) -> Error:
    """The exception for an Error message of the daemon."""
    if code == _VERSION:
        return ProtocolError(sentence)
    return _TYPES.get(code, Refused)(code, sentence)
