"""The plan of a soak, made from one seed: the scene, its scripted faults, and the commands.

The run is cut into episodes of the scene's loop. Times are the camera's sequence numbers. These go on
while it is unplugged and when the machine is too busy to make every frame, so that nothing here
depends on how fast the machine is.

    0 s        3 s    5 s     5.5 s    8.5 s  10.5 s   11 s     13 s       14.5 s     16 s
    no contact A is held     no contact B is held    no contact visitors no flag
    (undo at 6 s)                                                leave; rest is left
"""
from __future__ import annotations

import random
from dataclasses import dataclass, field

FPS = 60
EPISODE_S = 16
EPISODE = EPISODE_S * FPS

# Seconds of the episode. Objects are held a little longer than they are judged.
HOLD_A, HOLD_B = (3.0, 5.0), (8.5, 10.5)
EDGE_S = 0.2
#: Without contact for long enough that the gel is flat and the end of contact reported.
NO_CONTACT = (1.5, 2.4)
VISITORS_LEAVE, REST = 13.0, 13.5
#: All health flags of the episode are cleared by now.
CLEARED = (14.5, 16.0)

#: Flags that a busy machine raises by itself: frames that the simulated camera could not make in time, and
#: threads that did not run in time or without real-time scheduling. Counted, not faults; frames_lost and
#: camera_fault are compared with the frames that came (checks.py).
MACHINE = frozenset({"frames_lost", "camera_slow", "machine_slow", "camera_fault", "not_realtime"})
#: Faults under which frames do not come.
SWALLOWING = frozenset({"unplug", "stall", "hang", "drop", "truncate"})
#: The daemon reports lost frames for this long.
LOST_NS = 1_000_000_000
# A camera that comes back, and light that changes, are followed by a new reference image.
BEGUN_ANEW = frozenset({"starting", "light_unsettled", "reference_stale", "reference_restored"})


@dataclass(frozen=True)
class Step:
    """A command, due at a frame."""

    sequence: int
    verb: str  #: a method of commander.Commander
    #: The episode is not judged when the answer comes later than this frame. The first step does not
    #: even begin after it.
    latest: int
    value: int | bool | None = None


@dataclass
class Episode:
    index: int
    kind: str
    faults: list[tuple[str, int, int]] = field(default_factory=list)  #: kind, frame, frames
    steps: list[Step] = field(default_factory=list)
    must: frozenset[str] = frozenset()  #: health flags that have to be reported,
    may: frozenset[str] = frozenset()  #: and those that may
    events: frozenset[str] = frozenset()  #: kinds of events that have to come
    blind: tuple[int, int] | None = None  #: frames whose depth is wrong on request

    @property
    def first(self) -> int:
        return self.index * EPISODE

    def at(self, seconds: float) -> int:
        return self.first + round(seconds * FPS)

    def within(self, sequence: int, span: tuple[float, float], edge: float = 0.0) -> bool:
        return self.at(span[0] + edge) <= sequence < self.at(span[1] - edge)

    def place(self, sequence: int) -> str | None:
        """Where the truth is known and still: "A", "B", "no_contact" or None."""
        if self.blind and self.blind[0] <= sequence < self.blind[1]:
            return None
        if self.within(sequence, HOLD_A, EDGE_S):
            return "A"
        if self.within(sequence, HOLD_B, EDGE_S):
            return "B"
        if self.within(sequence, NO_CONTACT) or self.within(sequence, CLEARED):
            return "no_contact"
        return None


# ------------------------------------------------------------ the kinds of episodes

_EARLY = 0.5  # no contact
_CONTACT = 3.3  # A is held
_UNDO, _UNDONE = 6.0, 7.5  # no contact again


def _camera(kind, flag, *, in_contact=False, frames=(20, 100), may=BEGUN_ANEW):
    def make(episode, rng):
        at = episode.at((_CONTACT if in_contact else _EARLY) + rng.uniform(0, 0.4))
        episode.faults.append((kind, at, rng.randint(*frames)))
        episode.must = frozenset({flag})
        episode.may = may
    return make


def _light(*, in_contact=False, dark=False):
    def make(episode, rng):
        at = episode.at(_CONTACT if in_contact else _EARLY)
        level = 0 if dark else rng.randint(110, 235)
        until = episode.at(HOLD_A[1] if in_contact else 1.4 if dark else NO_CONTACT[1])
        undo, undone = (1.5, NO_CONTACT[1]) if dark else (_UNDO, _UNDONE)
        episode.steps = [Step(at, "light", until, level),
                         Step(episode.at(undo), "light", episode.at(undone), 255)]
        episode.must = frozenset({"light_unsettled"} | ({"reference_stale"} if in_contact else set()))
        episode.may = BEGUN_ANEW | {"image_dark"}
        episode.events = frozenset({"light", "reference"})
    return make


def _rezero(episode, _rng):
    episode.steps = [Step(episode.at(_EARLY), "rezero", episode.at(2.0), False)]
    episode.events = frozenset({"reference"})


def _rezero_in_contact(episode, _rng):
    episode.steps = [Step(episode.at(_CONTACT), "rezero_refused", episode.at(HOLD_A[1]))]


def _rezero_forced(episode, _rng):
    """The reference is taken of the pressed picture, as requested, until the next one."""
    episode.steps = [Step(episode.at(_CONTACT), "rezero", episode.at(HOLD_A[1]), True),
                     Step(episode.at(_UNDO), "rezero", episode.at(_UNDONE), True)]
    episode.events = frozenset({"reference"})
    episode.blind = (episode.at(_CONTACT - 0.1), episode.at(HOLD_B[0]))
    episode.may = BEGUN_ANEW | {"light_drifted", "beyond_calibration", "camera_shifted",
                                "exposure_unlocked"}


def _calibration(*, in_contact=False):
    def make(episode, _rng):
        at = (_CONTACT, HOLD_B[0] + 0.3) if in_contact else (_EARLY, _UNDO)
        episode.steps = [Step(episode.at(at[0]), "upload", episode.at(REST)),
                         Step(episode.at(at[1]), "activate", episode.at(REST), 0)]
        episode.events = frozenset({"calibration"})
    return make


def _calibration_broken(episode, _rng):
    episode.steps = [Step(episode.at(_EARLY), "upload_broken", episode.at(REST))]


def _quiet(_episode, _rng):
    pass


KINDS = {
    "quiet": _quiet,
    "unplug": _camera("unplug", "camera_fault"),
    "unplug_in_contact": _camera("unplug", "camera_fault", in_contact=True, frames=(20, 60)),
    "unplug_long": _camera("unplug", "camera_fault", frames=(300, 330)),
    "stall": _camera("stall", "camera_fault"),
    "stall_in_contact": _camera("stall", "camera_fault", in_contact=True, frames=(20, 60)),
    # Shorter than LOST_NS: the frame after it has to report.
    "hang": _camera("hang", "frames_lost", frames=(20, 45)),
    "drop": _camera("drop", "frames_lost", in_contact=True, frames=(1, 5)),
    "truncate": _camera("truncate", "frames_lost", in_contact=True, frames=(1, 5)),
    "repeat": _camera("repeat", "image_repeated", in_contact=True, frames=(10, 40)),
    "torn": _camera("torn", "image_repeated", frames=(10, 40)),
    "light": _light(),
    "light_in_contact": _light(in_contact=True),
    "dark": _light(dark=True),
    "rezero": _rezero,
    "rezero_in_contact": _rezero_in_contact,
    "rezero_forced": _rezero_forced,
    "calibration": _calibration(),
    "calibration_in_contact": _calibration(in_contact=True),
    "calibration_broken": _calibration_broken,
}
#: Kinds for a run that has time for two.
SHORT = ["unplug_in_contact", "light"]


def episodes(seed: int, count: int, kinds: list[str] | None = None) -> list[Episode]:
    """The first starts up without faults; then every kind once, in a random order, again and again."""
    rng = random.Random(f"episodes {seed}")
    order: list[str] = ["quiet"]
    while len(order) < count:
        order += kinds or rng.sample(sorted(KINDS), len(KINDS))
    made = []
    for index, kind in enumerate(order[:count]):
        episode = Episode(index, kind)
        KINDS[kind](episode, rng)
        if index == 0:
            episode.may = BEGUN_ANEW
        made.append(episode)
    return made


# ------------------------------------------------------------ the scene

def scene(seed: int, plan: list[Episode]) -> tuple[str, dict[str, str]]:
    """The scene file's text, and descriptions of A and B."""
    rng = random.Random(f"scene {seed}")

    def press(name, text, down, hold, deepest):
        x, y = rng.uniform(-3.5, 3.5), rng.uniform(-3.5, 3.5)
        depth, angle = rng.uniform(0.6, deepest), rng.uniform(0, 90)
        words[name] = f"{text.splitlines()[0].strip(chr(34))} {depth:.2f} mm deep"
        return (f"[[press]]\nobject = {text}\nkeys = [\n"
                f"  {{ t = {hold[0] - down}, x = {x:.3f}, y = {y:.3f}, depth = 0.0, "
                f"rotation = {angle:.1f} }},\n"
                f"  {{ t = {hold[0]}, depth = {depth:.3f} }},\n  {{ t = {hold[1]} }},\n"
                f"  {{ t = {hold[1] + down}, depth = 0.0 }},\n]\n")

    words: dict[str, str] = {}
    ball = f'"ball"\nradius_mm = {rng.uniform(4, 6):.2f}'
    other = rng.choice(['"m4_nut"', '"cylinder"\nradius_mm = 3.0\nlength_mm = 9.0'])
    text = f"[loop]\nfrom_s = 0.0\nto_s = {EPISODE_S}.0\n\n"
    text += press("A", ball, 0.5, HOLD_A, 1.1) + press("B", other, 0.5, HOLD_B, 0.9)
    for episode in plan:
        for kind, frame, frames in episode.faults:
            text += f'[[fault]]\nkind = "{kind}"\nframe = {frame}\nframes = {frames}\n'
    return text, words
