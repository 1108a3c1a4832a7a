"""Events of the daemon, and those that the client adds."""
from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from .messages import Message, name_of
from .values import Contact, Light, Reconstruction, health_names, wall_time


@dataclass(frozen=True)
class Event:
    """Fields of all events."""

    #: The last frame captured before it; 0: none yet.
    sequence: int
    time: datetime | None  #: UTC, by the daemon's clock; None of Reconnected
    monotonic_s: float | None  #: the daemon's CLOCK_MONOTONIC; None of Reconnected


@dataclass(frozen=True)
class ContactEvent(Event):
    """Contact was made or lost."""

    contact: Contact


@dataclass(frozen=True)
class LightEvent(Event):
    """The light changed."""

    light: Light


@dataclass(frozen=True)
class ReferenceEvent(Event):
    """A new reference image is in use."""

    restored: bool  #: the last good one from the daemon's state directory


@dataclass(frozen=True)
class StateEvent(Event):
    """The daemon's state or its health flags changed."""

    state: str
    health: tuple[str, ...]


@dataclass(frozen=True)
class ReconstructionEvent(Event):
    """Depth is made in another way."""

    reconstruction: Reconstruction


@dataclass(frozen=True)
class CalibrationEvent(Event):
    """Another calibration is in use."""

    name: str
    number: int | None


@dataclass(frozen=True)
class Reconnected(Event):
    """The connection was lost and is there again, subscribed as before. What happened meanwhile was
    not seen. `sequence` is that of the last frame before; a smaller one after it is that of a
    daemon or camera that began anew."""

    reason: str  #: why it was lost: a sentence
    away_s: float


def event_of(message: Message) -> Event | None:
    """From dtact.proto's Event; None for a kind that this package does not know."""
    kind = message.WhichOneof("what")
    if kind is None:
        return None
    m = getattr(message, kind)
    sequence, time = int(message.sequence), wall_time(message.wall_ns)
    monotonic_s = message.monotonic_ns * 1e-9
    if kind == "contact":
        return ContactEvent(sequence, time, monotonic_s, Contact.of(m.contact))
    if kind == "light":
        return LightEvent(sequence, time, monotonic_s, Light.of(m))
    if kind == "reference":
        return ReferenceEvent(sequence, time, monotonic_s, m.restored)
    if kind == "state":
        return StateEvent(sequence, time, monotonic_s, name_of("State", m.state),
                          health_names(m.health))
    if kind == "reconstruction":
        return ReconstructionEvent(sequence, time, monotonic_s, Reconstruction.of(m))
    number = m.number if m.HasField("number") else None
    return CalibrationEvent(sequence, time, monotonic_s, m.name, number)
