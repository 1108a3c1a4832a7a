"""What a soak has seen, gathered by episode."""
from __future__ import annotations

from dataclasses import dataclass, field

import plan
from daemon import Held


@dataclass(frozen=True)
class Arrived:
    """A frame: nanoseconds of the daemon's clock, and its health flags."""

    sequence: int
    taken: int
    published: int
    health: tuple[str, ...]


@dataclass
class Struck:
    """A fault under which frames do not come: what the honest client got around it."""

    kind: str
    frame: int
    frames: int
    before: Arrived | None = None
    came: int = 0  #: swallowed frames that came nevertheless
    after: Arrived | None = None

    def take(self, frame: Arrived):
        if frame.sequence < self.frame:
            self.before = frame
        elif frame.sequence < self.frame + self.frames:
            self.came += 1
        elif self.after is None:
            self.after = frame


@dataclass
class Seen:
    """Observations of one episode."""

    episode: plan.Episode
    frames: int = 0
    flags: set[str] = field(default_factory=set)
    events: set[str] = field(default_factory=set)
    cleared: list[Arrived] = field(default_factory=list)  #: the frames of the episode's last seconds,
    left: set[str] = field(default_factory=set)  #: and the health flags in them
    struck: list[Struck] = field(default_factory=list)
    lost_unseen: int = 0  #: frames that report lost ones although none is missing
    late: bool = False  #: a command came too late for the episode
    answer_s: float = 0.0  #: the longest that a command waited for its answer
    client_ms: list[float] = field(default_factory=list)
    daemon_ms: list[float] = field(default_factory=list)
    #: Frames without a health flag: place, inside, outside, untrusted.
    depths: list[tuple[str, float, float, float]] = field(default_factory=list)
    reported: int = 0  #: frames with a health flag, not judged


@dataclass
class Rest:
    at_s: float
    episode: int
    held: Held
    descriptors: list[str]
    load: float  #: the machine's, 1 minute
    late_s: float = 0.0  #: delay of the rest after plan.REST


class Record:
    """Collects the clients' reports."""

    def __init__(self, episodes: list[plan.Episode]):
        self.seen = [Seen(episode, struck=[Struck(*fault) for fault in episode.faults
                                           if fault[0] in plan.SWALLOWING])
                     for episode in episodes]
        self.rests: list[Rest] = []
        self.faults: list[str] = []
        self.answered = 0
        self.visits = 0
        self.log = ""
        self.ended = 0  #: the daemon's exit status
        self.seconds = 0.0
        self.states: list[tuple[int, tuple[str, ...]]] = []  #: since when, ns, and the health flags
        self._last = (-1, -1)  # sequence and stamp
        self._gap_ns = -1  # when the frame after the last gap was published

    def at(self, sequence: int) -> Seen | None:
        index = sequence // plan.EPISODE
        return self.seen[index] if index < len(self.seen) else None

    def take(self, word, *what):
        """One tuple of clients.py."""
        getattr(self, f"_{word}")(*what)

    def _fault(self, text):
        self.faults.append(text)

    def _visit(self, answered):
        self.visits += 1
        self.answered += answered

    def _frames(self, frames):
        for sequence, taken, ready, published, received, health in frames:
            if (sequence, taken) <= self._last or sequence <= self._last[0] or taken <= self._last[1]:
                self._fault(f"frame {sequence} taken at {taken} ns came after frame "
                            f"{self._last[0]} of {self._last[1]} ns")
            if not taken <= ready <= published <= received:
                self._fault(f"frame {sequence} was taken at {taken}, ready at {ready}, published at "
                            f"{published} and received at {received} ns")
            if sequence != self._last[0] + 1:
                self._gap_ns = published
            self._last = (sequence, taken)
            seen = self.at(sequence)
            if seen is None:
                continue
            frame = Arrived(sequence, taken, published, health)
            for struck in seen.struck:
                struck.take(frame)
            # The daemon noticed the loss at the latest in the frame that followed it.
            if "frames_lost" in health and taken - self._gap_ns >= plan.LOST_NS:
                seen.lost_unseen += 1
            seen.frames += 1
            seen.flags.update(health)
            seen.client_ms.append((received - ready) / 1e6)
            seen.daemon_ms.append((published - ready) / 1e6)
            if seen.episode.within(sequence, plan.CLEARED):
                seen.cleared.append(frame)
                seen.left.update(health)

    def _depth(self, sequence, health, place, inside, outside, untrusted, _stated):
        seen = self.at(sequence)
        if seen is None:
            return
        if set(health) - plan.MACHINE:
            seen.reported += 1
        else:
            seen.depths.append((place, inside, outside, untrusted))

    def event(self, sequence, kind, event):
        if kind == "state":
            self.states.append((round(event.monotonic_s * 1e9), event.health))
        seen = self.at(sequence)
        if seen is None:
            return
        seen.events.add(kind)
        if kind == "state":
            seen.flags.update(event.health)
